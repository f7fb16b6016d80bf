"""Parameters of both nodes that are not the core's own."""

from __future__ import annotations

from dataclasses import dataclass

from nav_controller.follow_params import FollowConfig, PersonLocatorConfig, check_follow
from tablerunner.config import Config, parameter
from tablerunner.control import (
    CONTROLLERS,
    BatteryConfig,
    BlockadeConfig,
    CautionConfig,
    ControllerSettings,
    FollowerConfig,
    MissionConfig,
    PlannerConfig,
    SafetyConfig,
    SurroundingsConfig,
    VelocityLimits,
)
from tablerunner.control.contour import ContourConfig
from tablerunner.control.fuzzy import ReactiveConfig, TrackConfig
from tablerunner.control.fuzzy.readings import FRAMES
from tablerunner.control.fuzzy_controller import DetourConfig
from tablerunner.errors import ConfigError
from tablerunner.geometry.pose import Pose2


@dataclass(frozen=True)
class NavNodeConfig(Config):
    """Everything about nav_controller."""

    scenario: str = parameter(description='Scenario file: walls, tables, robot')
    map_frame: str = parameter('map', description='Frame of goals and poses')
    odom_frame: str = parameter('odom', description='Frame of odom, for following a person')
    base_frame: str = parameter('base_link', description='Frame of the robot')
    control_rate: float = parameter(
        20.0, description='Velocities per second', unit='Hz', low=5.0, high=100.0
    )
    feedback_rate: float = parameter(
        5.0, description='Feedback messages per second', unit='Hz', low=0.5, high=100.0
    )
    twist_stamped: bool = parameter(
        False, description='Whether cmd_vel_nav is TwistStamped instead of Twist'
    )
    controller: str = parameter(
        CONTROLLERS[0], description='What follows the planned paths', choices=CONTROLLERS
    )
    ultrasonic_frames: tuple[str, ...] = parameter(
        FRAMES, description='Frames of the five ultrasonic sensors, from left to right'
    )
    publish_trace: bool = parameter(
        False,
        description='Whether fuzzy_trace tells which rules fire, how strongly, what comes out',
        dynamic=True,
    )
    limits: VelocityLimits = parameter(
        factory=VelocityLimits, description='Velocity limits, within those of the base'
    )
    follower: FollowerConfig = parameter(
        factory=FollowerConfig, description='How paths end, and how pure_pursuit follows them'
    )
    track: TrackConfig = parameter(
        factory=TrackConfig, description='How the fuzzy controller keeps to a path'
    )
    reactive: ReactiveConfig = parameter(
        factory=ReactiveConfig, description='How it drives by what it hears'
    )
    contour: ContourConfig = parameter(
        factory=ContourConfig, description='How it goes along what is in its way'
    )
    detour: DetourConfig = parameter(
        factory=DetourConfig, description='When it leaves the path for that'
    )
    planner: PlannerConfig = parameter(factory=PlannerConfig, description='What a good way is')
    surroundings: SurroundingsConfig = parameter(
        factory=SurroundingsConfig,
        description='How what the sensors find beside the map is weighed',
    )
    caution: CautionConfig = parameter(
        factory=CautionConfig, description='How careful it is where somebody may step into its way'
    )
    blockade: BlockadeConfig = parameter(
        factory=BlockadeConfig, description='When what is in the way is there to stay'
    )
    mission: MissionConfig = parameter(
        factory=MissionConfig, description='How patient a mission is'
    )
    battery: BatteryConfig = parameter(
        factory=BatteryConfig, description='When the battery counts as low'
    )
    follow: FollowConfig = parameter(factory=FollowConfig, description='How a person is followed')
    person: PersonLocatorConfig = parameter(
        factory=PersonLocatorConfig,
        description='Whose tag, and from which anchors; none: those of the scenario',
    )
    queue_file: str = parameter(
        '', description='File that keeps the deliveries over a restart; empty: none does'
    )
    queue_limit: int = parameter(
        20, description='Most deliveries that are under way or wait', low=1, high=1000
    )

    def check(self) -> None:
        """Want five sensors, and a least speed that the limits allow."""
        frames = self.ultrasonic_frames
        if len(frames) != len(FRAMES) or len(set(frames)) != len(frames):
            raise ConfigError(
                'ultrasonic_frames', list(frames), f'{len(FRAMES)} frames, each once'
            )
        if self.reactive.min_speed > self.limits.max_speed:
            raise ConfigError(
                'reactive.min_speed', self.reactive.min_speed, 'at most limits.max_speed'
            )
        check_follow(self.follow)

    @property
    def controllers(self) -> ControllerSettings:
        """What the path controllers are set to."""
        return ControllerSettings(
            self.follower, self.track, self.reactive, self.contour, self.detour
        )


NAV_TWISTS = ('same', 'twist', 'twist_stamped')


@dataclass(frozen=True)
class SafetyNodeConfig(Config):
    """Everything about safety_stop."""

    scenario: str = parameter(
        '',
        description='Scenario file to take sensors, footprint and base limits from; may be empty',
    )
    ultrasonic_frames: tuple[str, ...] = parameter(
        FRAMES, description='Frames of the ultrasonic sensors; all must be heard'
    )
    ultrasonic_poses: tuple[float, ...] = parameter(
        (
            *(0.0, 0.22, 1.5708),
            *(0.1685, 0.1414, 0.6981),
            *(0.22, 0.0, 0.0),
            *(0.1685, -0.1414, -0.6981),
            *(0.0, -0.22, -1.5708),
        ),
        description='x, y [m], heading [rad] of each sensor in base_link, one after the other',
    )
    map_frame: str = parameter('map', description='Frame of the pose')
    base_frame: str = parameter('base_link', description='Frame of the robot')
    watch_rate: float = parameter(
        20.0, description='Checks per second when no command comes', unit='Hz', low=5.0, high=100.0
    )
    clock_timeout: float = parameter(
        0.5,
        description='Stop when the node clock stands still for longer (wall time)',
        unit='s',
        above=0.0,
        high=5.0,
    )
    twist_stamped: bool = parameter(
        False, description='Whether cmd_vel is TwistStamped instead of Twist'
    )
    nav_twist: str = parameter(
        NAV_TWISTS[0],
        description='Type of cmd_vel_nav: the same as of cmd_vel, or another',
        choices=NAV_TWISTS,
    )
    limits: VelocityLimits = parameter(
        factory=VelocityLimits, description='Velocity limits, within those of the base'
    )
    safety: SafetyConfig = parameter(
        factory=SafetyConfig, description='When to slow down and to stop'
    )

    def check(self) -> None:
        """Want one pose for each sensor, and each sensor once."""
        wanted = 3 * len(self.ultrasonic_frames)
        if len(self.ultrasonic_poses) != wanted:
            raise ConfigError(
                'ultrasonic_poses',
                list(self.ultrasonic_poses),
                f'{wanted} numbers: x, y, heading for each of ultrasonic_frames',
            )
        if len(set(self.ultrasonic_frames)) != len(self.ultrasonic_frames):
            raise ConfigError('ultrasonic_frames', list(self.ultrasonic_frames), 'each frame once')

    @property
    def takes_stamped(self) -> bool:
        """Whether cmd_vel_nav is TwistStamped."""
        if self.nav_twist == 'same':
            return self.twist_stamped
        return self.nav_twist == 'twist_stamped'

    @property
    def mounts(self) -> dict[str, Pose2]:
        """Pose of each sensor in base_link by frame."""
        numbers = iter(self.ultrasonic_poses)
        return {
            frame: Pose2(*next(zip(numbers, numbers, numbers, strict=False)))
            for frame in self.ultrasonic_frames
        }
