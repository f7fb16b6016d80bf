"""Records to messages of `rosbags`, for bags that are written without ROS.

The counterpart for rclpy is ``tablerunner_ros.conversions``; the way back, for both, is
`tablerunner.messages`.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

import numpy as np

from tablerunner.bags.definitions import known_types
from tablerunner.geometry.pose import Pose2
from tablerunner.messages.covariance import (
    pose_covariance_to_message,
    twist_covariance_to_message,
)
from tablerunner.types import (
    NANOSECONDS,
    Anchor,
    ExchangeSample,
    ImuSample,
    Innovation,
    MagneticSample,
    Matrix,
    OdometrySample,
    PoseSample,
    RangeSample,
    UltrasonicSample,
    Velocity,
    WheelSample,
)

ULTRASOUND = 0
"""``radiation_type`` of sensor_msgs/Range."""


def make(msgtype: str, **fields: Any) -> Any:
    """Return a message of a known type; every field must be given."""
    return known_types().types[msgtype](**fields)


def clock_message(stamp: int) -> Any:
    """Return a time as a message of the clock."""
    return make('rosgraph_msgs/msg/Clock', clock=_time(stamp))


def exchange_message(sample: ExchangeSample, frame: str) -> Any:
    """Return an exchange as a message; `frame` is that of the tag's antenna."""
    return make(
        'tablerunner_interfaces/msg/UwbExchange',
        header=header(sample.stamp, frame),
        anchor_id=sample.anchor_id,
        tag_id=sample.tag_id,
        sequence=sample.sequence,
        poll_tx=sample.poll_tx,
        poll_rx=sample.poll_rx,
        response_tx=sample.response_tx,
        response_rx=sample.response_rx,
        final_tx=sample.final_tx,
        final_rx=sample.final_rx,
        rx_power=sample.rx_power_dbm,
        first_path_power=sample.first_path_power_dbm,
    )


def range_message(sample: RangeSample, frame: str) -> Any:
    """Return a range as a message; `frame` is that of the tag's antenna."""
    return make(
        'tablerunner_interfaces/msg/UwbRange',
        header=header(sample.stamp, frame),
        anchor_id=sample.anchor_id,
        tag_id=sample.tag_id,
        sequence=sample.sequence,
        range=sample.range_m,
        variance=sample.variance_m2,
        raw_range=sample.raw_range_m,
        rx_power=sample.rx_power_dbm,
        first_path_power=sample.first_path_power_dbm,
        los=int(sample.los),
        nlos_probability=sample.nlos_probability,
        LOS_UNKNOWN=0,
        LOS=1,
        NLOS=2,
    )


def anchors_message(anchors: Iterable[Anchor], stamp: int, frame: str) -> Any:
    """Return anchors as a message; `frame` is that of their positions."""
    return make(
        'tablerunner_interfaces/msg/UwbAnchorArray',
        header=header(stamp, frame),
        anchors=[
            make(
                'tablerunner_interfaces/msg/UwbAnchor',
                anchor_id=anchor.anchor_id,
                position=_point(*anchor.position),
                covariance=(np.eye(3) * anchor.position_variance_m2).ravel(),
                bias=anchor.bias_m,
            )
            for anchor in anchors
        ],
    )


def wheels_message(sample: WheelSample, left_joint: str, right_joint: str, frame: str = '') -> Any:
    """Return angles and, where known, speeds of both wheels as a message."""
    speeds = np.array([sample.left_speed_rad_s, sample.right_speed_rad_s])
    return make(
        'sensor_msgs/msg/JointState',
        header=header(sample.stamp, frame),
        name=[left_joint, right_joint],
        position=np.array([sample.left_angle_rad, sample.right_angle_rad]),
        velocity=np.empty(0) if np.isnan(speeds).any() else speeds,
        effort=np.empty(0),
    )


def imu_message(sample: ImuSample, frame: str) -> Any:
    """Return a sample as a message of an IMU that is mounted along base_link."""
    orientation, acceleration, rate = np.zeros(9), np.zeros(9), np.zeros(9)
    rate[8] = sample.yaw_rate_variance
    heading = sample.yaw_rad
    if math.isnan(heading):
        orientation[0], heading = -1.0, 0.0
    forward, lateral = sample.forward_acceleration_m_s2, sample.lateral_acceleration_m_s2
    if math.isnan(forward):
        acceleration[0], forward, lateral = -1.0, 0.0, 0.0
    return make(
        'sensor_msgs/msg/Imu',
        header=header(sample.stamp, frame),
        orientation=_quaternion(heading),
        orientation_covariance=orientation,
        angular_velocity=_vector(0.0, 0.0, sample.yaw_rate_rad_s),
        angular_velocity_covariance=rate,
        linear_acceleration=_vector(forward, lateral, 0.0),
        linear_acceleration_covariance=acceleration,
    )


def magnetic_message(sample: MagneticSample, frame: str) -> Any:
    """Return a sample as a message of a magnetometer that is mounted along base_link."""
    return make(
        'sensor_msgs/msg/MagneticField',
        header=header(sample.stamp, frame),
        magnetic_field=_vector(sample.field_x_t, sample.field_y_t, sample.field_z_t),
        magnetic_field_covariance=np.zeros(9),
    )


def ultrasonic_message(sample: UltrasonicSample) -> Any:
    """Return a reading as a message; its frame is the sensor's name."""
    return make(
        'sensor_msgs/msg/Range',
        header=header(sample.stamp, sample.sensor),
        radiation_type=ULTRASOUND,
        field_of_view=sample.field_of_view_rad,
        min_range=sample.min_range_m,
        max_range=sample.max_range_m,
        range=sample.range_m,
        variance=0.0,
    )


def odometry_message(sample: OdometrySample, frame: str, child: str) -> Any:
    """Return odometry (or the truth) as a message."""
    return make(
        'nav_msgs/msg/Odometry',
        header=header(sample.stamp, frame),
        child_frame_id=child,
        pose=_pose_with_covariance(sample.pose, sample.pose_covariance),
        twist=make(
            'geometry_msgs/msg/TwistWithCovariance',
            twist=twist_message(Velocity(sample.linear_m_s, sample.angular_rad_s)),
            covariance=twist_covariance_to_message(sample.twist_covariance),
        ),
    )


def pose_message(sample: PoseSample, frame: str) -> Any:
    """Return a pose with covariance as a message."""
    return make(
        'geometry_msgs/msg/PoseWithCovarianceStamped',
        header=header(sample.stamp, frame),
        pose=_pose_with_covariance(sample.pose, sample.covariance),
    )


def goal_message(pose: Pose2, stamp: int, frame: str) -> Any:
    """Return a pose without covariance as a message."""
    return make('geometry_msgs/msg/PoseStamped', header=header(stamp, frame), pose=_pose(pose))


def path_message(poses: Iterable[Pose2], stamp: int, frame: str) -> Any:
    """Return poses as a path."""
    return make(
        'nav_msgs/msg/Path',
        header=header(stamp, frame),
        poses=[goal_message(pose, stamp, frame) for pose in poses],
    )


def twist_message(velocity: Velocity) -> Any:
    """Return a velocity as a message."""
    return make(
        'geometry_msgs/msg/Twist',
        linear=_vector(velocity.linear_m_s, 0.0, 0.0),
        angular=_vector(0.0, 0.0, velocity.angular_rad_s),
    )


def innovation_message(record: Innovation, frame: str, estimator: str) -> Any:
    """Return an innovation as a message; `frame` is that of the estimate."""
    return make(
        'tablerunner_interfaces/msg/Innovation',
        header=header(record.stamp, frame),
        source=record.source,
        key=record.key,
        estimator=estimator,
        innovation=np.asarray(record.innovation, dtype=np.float64),
        variance=np.ascontiguousarray(record.covariance, dtype=np.float64).ravel(),
        nis=record.nis,
        gate=record.gate,
        accepted=record.accepted,
        reason=record.reason,
    )


def transforms_message(transforms: Iterable[tuple[int, str, str, Pose2]]) -> Any:
    """Return transforms in the plane, each (stamp, parent, child, pose), as a message of tf."""
    return make(
        'tf2_msgs/msg/TFMessage',
        transforms=[
            make(
                'geometry_msgs/msg/TransformStamped',
                header=header(stamp, parent),
                child_frame_id=child,
                transform=make(
                    'geometry_msgs/msg/Transform',
                    translation=_vector(pose.x, pose.y, 0.0),
                    rotation=_quaternion(pose.heading),
                ),
            )
            for stamp, parent, child, pose in transforms
        ],
    )


def _time(stamp: int) -> Any:
    sec, nanosec = divmod(stamp, NANOSECONDS)
    return make('builtin_interfaces/msg/Time', sec=sec, nanosec=nanosec)


def header(stamp: int, frame: str) -> Any:
    """Return stamp [ns] and frame as a header."""
    return make('std_msgs/msg/Header', stamp=_time(stamp), frame_id=frame)


def _vector(x: float, y: float, z: float) -> Any:
    return make('geometry_msgs/msg/Vector3', x=x, y=y, z=z)


def _point(x: float, y: float, z: float) -> Any:
    return make('geometry_msgs/msg/Point', x=x, y=y, z=z)


def _quaternion(heading: float) -> Any:
    return make(
        'geometry_msgs/msg/Quaternion',
        x=0.0,
        y=0.0,
        z=math.sin(0.5 * heading),
        w=math.cos(0.5 * heading),
    )


def _pose(pose: Pose2) -> Any:
    return make(
        'geometry_msgs/msg/Pose',
        position=_point(pose.x, pose.y, 0.0),
        orientation=_quaternion(pose.heading),
    )


def _pose_with_covariance(pose: Pose2, covariance: Matrix) -> Any:
    return make(
        'geometry_msgs/msg/PoseWithCovariance',
        pose=_pose(pose),
        covariance=pose_covariance_to_message(covariance),
    )
