"""Dead reckoning from wheel encoders and an IMU."""

from tablerunner.odometry.motion import Motion, MotionNoise, between_poses
from tablerunner.odometry.odometer import Odometer, OdometerConfig

__all__ = ['Motion', 'MotionNoise', 'Odometer', 'OdometerConfig', 'between_poses']
