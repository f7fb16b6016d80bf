"""Tablerunner's core: ranging, odometry, estimation, control and simulation without ROS."""

__version__ = '0.1.0'
