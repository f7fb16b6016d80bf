"""What fusion_node publishes of an estimate: odometry/filtered, pose, map to odom, its state."""

from __future__ import annotations

from diagnostic_msgs.msg import DiagnosticStatus, KeyValue
from geometry_msgs.msg import PoseWithCovarianceStamped
from nav_msgs.msg import Odometry
from rclpy.node import Node

from tablerunner.estimation import (
    LocalizerState,
    LocalizerStatus,
    SmootherConfig,
    TransformSmoother,
)
from tablerunner.geometry.pose import Pose2
from tablerunner.types import Estimate, Matrix, OdometrySample
from tablerunner_ros.conversions.odometry import fill_odometry
from tablerunner_ros.conversions.pose import fill_pose_with_covariance
from tablerunner_ros.diagnostics import ERROR, OK, WARN
from tablerunner_ros.qos import qos_for
from tablerunner_ros.transforms import TransformBroadcaster

_LEVELS = {
    LocalizerState.WAITING: WARN,
    LocalizerState.ALIGNING: WARN,
    LocalizerState.TRACKING: OK,
    LocalizerState.LOST: ERROR,
}


def level_of(status: LocalizerStatus) -> bytes:
    """Return how bad it is, as DiagnosticStatus has it."""
    return WARN if status.degraded else _LEVELS[status.state]


class EstimateOutput:
    """Publishers of the estimate; their messages are made once and filled each time.

    Parameters
    ----------
    node : rclpy.node.Node
    map_frame, odom_frame, base_frame : str
    publish_tf : bool
        Whether map to odom is broadcast.
    """

    def __init__(
        self, node: Node, map_frame: str, odom_frame: str, base_frame: str, publish_tf: bool
    ) -> None:
        self._odometry = Odometry()
        self._odometry.header.frame_id = map_frame
        self._odometry.child_frame_id = base_frame
        self._pose = PoseWithCovarianceStamped()
        self._pose.header.frame_id = map_frame
        self._odometry_publisher = node.create_publisher(
            Odometry, 'odometry/filtered', qos_for('odometry/filtered')
        )
        self._pose_publisher = node.create_publisher(
            PoseWithCovarianceStamped, 'pose', qos_for('pose')
        )
        self._name = node.get_name()
        self._state_publisher = node.create_publisher(
            DiagnosticStatus, 'fusion_state', qos_for('fusion_state')
        )
        self._told: tuple[object, ...] = ()
        self._tf = TransformBroadcaster(node, map_frame, odom_frame) if publish_tf else None
        self._smoother = TransformSmoother(SmootherConfig())
        self._starts = 0

    def odometry(
        self, estimate: Estimate, velocity: tuple[float, float], twist_covariance: Matrix
    ) -> None:
        """Publish the estimate as odometry; `velocity` is forward [m/s] and turning [rad/s]."""
        fill_odometry(
            self._odometry,
            OdometrySample(
                estimate.stamp,
                estimate.pose,
                velocity[0],
                velocity[1],
                estimate.pose_covariance,
                twist_covariance,
            ),
        )
        self._odometry_publisher.publish(self._odometry)

    def pose(self, estimate: Estimate) -> None:
        """Publish the estimate as a pose with covariance, honest before the start is known."""
        fill_pose_with_covariance(
            self._pose, estimate.stamp, estimate.pose, estimate.pose_covariance
        )
        self._pose_publisher.publish(self._pose)

    def state(self, status: LocalizerStatus) -> None:
        """Publish the state of localisation when it has changed: the safety stop goes by it."""
        cause = '' if status.cause is None else status.cause.value
        if (status.state, cause) == self._told:
            return
        self._told = (status.state, cause)
        values = {'state': status.state.value, 'pose by': cause}
        self._state_publisher.publish(
            DiagnosticStatus(
                level=level_of(status),
                name=self._name,
                message=status.words,
                values=[KeyValue(key=key, value=value) for key, value in values.items()],
            )
        )

    def configure(self, config: SmootherConfig) -> None:
        """Move map to odom more or less gently from now on."""
        self._smoother.config = config

    def transform(self, estimate: Estimate, map_to_odom: Pose2, starts: int) -> None:
        """Broadcast where odom lies in map; another number of `starts` is another estimate."""
        if self._tf is None:
            return
        if starts != self._starts:
            self._starts = starts
            self._smoother.reset()
        shown = self._smoother.follow(estimate.stamp, map_to_odom, estimate.pose)
        self._tf.send(estimate.stamp, shown)
