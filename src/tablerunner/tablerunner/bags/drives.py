"""What a drive tells of anchors and wheels: its track, wheel angles, and ranges, out of a bag."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tablerunner.bags.reader import BagReader
from tablerunner.bags.streams import Names, bag_records, converters, full_name
from tablerunner.errors import BagError, ConfigError
from tablerunner.odometry import Motion, Odometer, OdometerConfig
from tablerunner.odometry.gyro import Gyro
from tablerunner.odometry.wheels import Wheels
from tablerunner.survey.record import RangeTable
from tablerunner.survey.track import Track
from tablerunner.survey.wheel_motion import WheelAngles
from tablerunner.types import (
    Anchor,
    ExchangeSample,
    ImuSample,
    OdometrySample,
    RangeSample,
    Refusal,
    WheelSample,
)
from tablerunner.uwb import Ranger, RangerConfig

Array = NDArray[np.float64]

_BLOCKED_ABOVE = 0.5
_GYRO_LATE_S = 2.0


@dataclass(frozen=True)
class RecordedDrive:
    """What a bag holds of a drive.

    Attributes
    ----------
    track : Track
        Of base_link by dead reckoning.
    wheels : WheelAngles or None
        None where the bag has odometry only.
    ranges : RangeTable
        Of the robot's tag; those whose signal says that they are blocked are left out.
    links : dict of (str, str) to ndarray
        Ranges between anchors [m].
    blocked : dict of str to int
        How many were left out of each anchor.
    anchors : tuple of Anchor
        As uwb/anchors of the bag says; empty without.
    notes : tuple of str
        What the user should know of the recording.
    """

    track: Track
    wheels: WheelAngles | None
    ranges: RangeTable
    links: dict[tuple[str, str], Array]
    blocked: dict[str, int]
    anchors: tuple[Anchor, ...]
    notes: tuple[str, ...]


def read_drive(
    bag: BagReader,
    odometer: OdometerConfig,
    namespace: str = '',
    raw: bool = True,
    names: Names | None = None,
) -> RecordedDrive:
    """Read a drive.

    Parameters
    ----------
    bag : BagReader
        Holds joint_states (with imu/data, if there is a gyroscope) or odom, and uwb/exchanges or
        uwb/ranges.
    odometer : OdometerConfig
        As of odom_node.
    namespace : str
        Namespace of the robot in the bag.
    raw : bool
        Whether uwb/ranges are taken as they were before calibration.
    names : Names, optional
        Joints of the wheels and mounting of the IMU. Frames do not matter: nothing here is
        compared with what others know of the same frame.

    Raises
    ------
    BagError
        The bag holds no odometry or no ranges.
    ConfigError
        The ranges are of several tags.
    """

    def present(topic: str) -> bool:
        found = bag.topic(full_name(topic, namespace))
        return found is not None and found.count > 0

    moved = next((topic for topic in ('joint_states', 'odom') if present(topic)), None)
    if moved is None:
        raise BagError(f'{bag.path} holds neither joint_states nor odom: how did the robot move?')
    ranged = next((topic for topic in ('uwb/exchanges', 'uwb/ranges') if present(topic)), None)
    if ranged is None:
        raise BagError(f'{bag.path} holds neither uwb/exchanges nor uwb/ranges')
    topics = [moved, ranged, 'uwb/anchors', *(['imu/data'] if moved == 'joint_states' else [])]
    gathered = _Gathered(odometer)
    use = replace(names or Names(), map_frame='', odom_frame='', base_frame='')
    present_topics = [topic for topic in topics if present(topic)]
    refused = ''  # why the first sample of motion was
    for item in bag_records(bag, present_topics, namespace, converters(use)):
        if item.topic == moved and isinstance(item.record, Refusal):
            refused = refused or item.record.reason
        gathered.take(item.record)
    if len(gathered.odometry) < 2:
        why = f': {refused}' if refused else ''
        if moved == 'joint_states':
            why += f' (expected are {", ".join((*use.left_joints, *use.right_joints))})'
        raise BagError(f'{bag.path}: no sample of {moved} could be used{why}')
    track = Track.of(gathered.odometry)
    samples = gathered.all_ranges()
    table, links, blocked = _sorted_out(samples, raw)
    wheels, notes = gathered.wheel_angles()
    return RecordedDrive(
        track, wheels, table, links, blocked, gathered.anchors, (*gathered.notes, *notes)
    )


class _Gathered:
    """Samples of a bag, as they come."""

    def __init__(self, odometer: OdometerConfig) -> None:
        self._odometer = Odometer(odometer)
        self._wheels, self._gyro = Wheels(odometer.wheels), Gyro(odometer.gyro)
        self._radius, self._track = odometer.wheels.wheel_radius, odometer.wheels.track
        self._rows: list[tuple[int, float, float, float]] = []
        self._silences = 0
        self._exchanges: list[ExchangeSample] = []
        self._ranges: list[RangeSample] = []
        self.odometry: list[OdometrySample] = []
        self.anchors: tuple[Anchor, ...] = ()

    def take(self, record: object) -> None:
        """Take one record; refusals are left out."""
        if isinstance(record, WheelSample):
            self._take_wheels(record)
        elif isinstance(record, ImuSample):
            self._odometer.add_imu(record)
            self._gyro.add(record)
        elif isinstance(record, OdometrySample):
            self.odometry.append(record)
        elif isinstance(record, ExchangeSample):
            self._exchanges.append(record)
        elif isinstance(record, RangeSample):
            self._ranges.append(record)
        elif isinstance(record, tuple) and not self.anchors:
            self.anchors = record

    def _take_wheels(self, sample: WheelSample) -> None:
        moved = self._odometer.add_wheels(sample)
        if isinstance(moved, OdometrySample):
            self.odometry.append(moved)
        motion = self._wheels.add(sample)
        if isinstance(motion, Refusal):
            self._silences += motion.reason == 'encoders were silent'
            return
        alive = self._gyro.alive(sample.stamp)
        angle = self._gyro.angle(sample.stamp) if alive else float('nan')
        left, right = self._rows[-1][1:3] if self._rows else (0.0, 0.0)
        if isinstance(motion, Motion):
            half = 0.5 * motion.turn_rad * self._track
            left += (motion.distance_m - half) / self._radius
            right += (motion.distance_m + half) / self._radius
        if not self._rows or sample.stamp > self._rows[-1][0]:
            self._rows.append((sample.stamp, left, right, angle))

    @property
    def notes(self) -> tuple[str, ...]:
        """What the user should know of the encoders."""
        if not self._silences:
            return ()
        return (f'encoders were silent {self._silences} times: the way meanwhile is lost',)

    def wheel_angles(self) -> tuple[WheelAngles | None, tuple[str, ...]]:
        """Return the angles of the wheels with those of the gyroscope, where it never failed."""
        if len(self._rows) < 2:
            return None, ()
        stamps = np.array([row[0] for row in self._rows], dtype=np.int64)
        angles = np.array([row[1:3] for row in self._rows])
        gyro = np.array([row[3] for row in self._rows])
        known = np.flatnonzero(np.isfinite(gyro))
        if not len(known):
            return WheelAngles(stamps, angles), ('no imu/data: the wheels alone tell the turns',)
        first = int(known[0])
        late = (stamps[first] - stamps[0]) / 1e9 > _GYRO_LATE_S
        if late or not np.isfinite(gyro[first:]).all():
            return WheelAngles(stamps, angles), ('imu/data was silent at times: not used',)
        return WheelAngles(stamps[first:], angles[first:], gyro[first:]), ()

    def all_ranges(self) -> list[RangeSample]:
        """Return the ranges, those of exchanges without any calibration."""
        if not self._exchanges:
            return self._ranges
        names = tuple(sorted({item.anchor_id for item in self._exchanges}))
        ranger = Ranger(
            replace(
                RangerConfig(),
                anchor_ids=names,
                anchor_positions=(0.0,) * (3 * len(names)),
                nlos_test='signal_quality',
            )
        )
        made = [ranger.add(item) for item in self._exchanges]
        return [item for item in made if isinstance(item, RangeSample)]


def _sorted_out(
    samples: list[RangeSample], raw: bool
) -> tuple[RangeTable, dict[tuple[str, str], Array], dict[str, int]]:
    """Return the ranges of the robot's tag, those between anchors, and how many are blocked."""
    ids = tuple(sorted({item.anchor_id for item in samples}))
    between: dict[tuple[str, str], list[float]] = {}
    own: list[RangeSample] = []
    blocked = dict.fromkeys(ids, 0)
    for item in samples:
        if item.nlos_probability > _BLOCKED_ABOVE:
            blocked[item.anchor_id] += 1
        elif item.tag_id in ids:
            first, second = sorted((item.anchor_id, item.tag_id))
            between.setdefault((first, second), []).append(_value(item, raw))
        else:
            own.append(item)
    tags = sorted({item.tag_id for item in own})
    if len(tags) > 1:
        raise ConfigError('tag', ', '.join(tags), 'ranges of one tag, the one of the robot')
    return (
        RangeTable(
            ids,
            np.array([item.stamp for item in own], dtype=np.int64),
            np.array([ids.index(item.anchor_id) for item in own], dtype=np.intp),
            np.array([_value(item, raw) for item in own], dtype=float),
        ),
        {pair: np.array(values) for pair, values in between.items()},
        blocked,
    )


def _value(item: RangeSample, raw: bool) -> float:
    return item.raw_range_m if raw and item.raw_range_m > 0.0 else item.range_m
