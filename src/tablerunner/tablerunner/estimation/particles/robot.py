"""Particle filters of the robot: odometry in, ranges, poses and headings in, a pose out.

`pf` proposes by the motion alone, `pf_ekf`, `pf_iekf` and `pf_uiekf` by what the named filter
makes of each particle and the measurement (`draw`). They begin anywhere in the room, or at a pose.

Ranges are judged as in the `ekf`, by what all particles together expect: gate, Huber's weight, and
each anchor's mean innovation in `Estimate.memory`. Random numbers hang on the seed and on the
stamp of the measurement alone, so that data put in their place late give what data on time give.
"""

from __future__ import annotations

import math
import zlib
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from tablerunner.estimation.ekf import CLIP, LONG, SHORT, bias_covariance, range_variance
from tablerunner.estimation.estimator import RANGE_SOURCE, EstimatorConfig, Measurement, Start
from tablerunner.estimation.models.range_model import STANDING, Point3
from tablerunner.estimation.particles.anywhere import room_of
from tablerunner.estimation.particles.draw import Seen, Sighting, absorbed, foreseen, view_of
from tablerunner.estimation.particles.iterated import Array, Iteration
from tablerunner.estimation.particles.particle_filter import PROPOSALS
from tablerunner.estimation.particles.sight import position_of, ranges_of
from tablerunner.estimation.particles.swarm import Swarm, Way, rotation
from tablerunner.geometry.angles import wrap
from tablerunner.odometry.motion import Motion
from tablerunner.types import (
    Anchor,
    Estimate,
    HeadingSample,
    Innovation,
    Matrix,
    PoseSample,
    RangeSample,
    Vector,
)

_NAMES = ('x', 'y', 'heading', 'scale', 'turn_scale', 'gyro_bias')
NO_PARTICLE = 'no particle fits'
"""Why a measurement was refused that no particle explains at all."""


class _Judged(NamedTuple):
    """What is done with ranges of one instant."""

    extra: Vector  # (m,), added variance [m^2]
    reasons: tuple[str, ...]
    accepted: tuple[bool, ...]
    memory: tuple[float, ...]
    forgotten: tuple[int, ...]  # anchors whose bias was something in the way that is gone


class RobotParticleFilter:
    """A particle filter on odometry, ranges, poses and headings."""

    name = 'pf'
    takes_positions = False

    def __init__(
        self, config: EstimatorConfig, anchors: tuple[Anchor, ...], lever_arm: Point3
    ) -> None:
        self.config = config
        self.lever_arm = lever_arm
        ids = tuple(anchor.anchor_id for anchor in anchors)
        self.state_names = (*_NAMES, *(f'range_bias.{anchor_id}' for anchor_id in ids))
        self._anchors = {anchor.anchor_id: (i, anchor) for i, anchor in enumerate(anchors)}
        self._iteration: Iteration | None = PROPOSALS[self.name]
        self._usual_bias = math.hypot(config.range_bias_common_std, config.range_bias_std)

    def start(self, start: Start) -> Estimate:
        """Return the first estimate: the given pose, or anywhere in the room."""
        config, count = self.config, len(self._anchors)
        if start.anywhere:
            poses, way = self._anywhere(start)
        else:
            poses = np.tile(np.asarray(start.pose, dtype=float), (config.particles.least, 1))
            # All are one pose; the first measurement draws them apart.
            turn = rotation(poses[:1, 2])[0]
            way = Way(np.zeros(3), np.zeros((3, 3)), turn.T @ start.pose_covariance @ turn)
        deviations = (config.scale_std, config.turn_scale_std, config.gyro_bias_std)
        biases = np.zeros(count) if start.range_biases is None else start.range_biases
        # A range scale that is not carried is a bias, at the usual distance.
        scale = (config.range_scale_std * _USUAL_RANGE_M) ** 2
        swarm = Swarm(
            poses,
            np.zeros((len(poses), 3)),
            np.tile(biases, (len(poses), 1)),
            np.full(len(poses), -math.log(len(poses))),
            np.diag(np.square(deviations)),
            bias_covariance(config, count) + scale * np.eye(count),
            way,
        )
        first = _estimate(start.stamp, swarm, STANDING, (0.0,) * count)
        if not start.anywhere:
            first.mean[:3] = start.pose  # exactly
            first.mean[2] = wrap(float(start.pose[2]))
        return first

    def _anywhere(self, start: Start) -> tuple[Matrix, Way]:
        """Return poses all over the room, each uncertain by the distance to the next."""
        settings = self.config.particles
        anchors = [anchor for _, anchor in self._anchors.values()]
        low_x, low_y, high_x, high_y = room_of(self.config, anchors)
        rng = self._random(start.stamp, 'start')
        count = settings.at_start
        poses = rng.random((count, 3)) * (high_x - low_x, high_y - low_y, 2.0 * math.pi)
        poses += (low_x, low_y, -math.pi)
        side = (high_x - low_x) * (high_y - low_y) / count
        turn = 2.0 * math.pi / math.sqrt(count)
        return poses, Way(np.zeros(3), np.zeros((3, 3)), np.diag([side, side, turn**2]) / 12.0)

    def predict(self, estimate: Estimate, motion: Motion, stamp: int) -> Estimate:
        """Return the estimate carried to `stamp` by a motion."""
        swarm, config = _swarm(estimate), self.config
        length, turned, dt_s = abs(motion.distance_m), abs(motion.turn_rad), motion.dt_s
        errors = swarm.mean_errors
        standing = length == 0.0 and turned == 0.0
        variances = (0.0, 0.0) if standing else config.motion.variances(motion)
        extra = np.zeros(3)
        if not standing and self._doubts(estimate):
            extra[:2] = config.doubt_std**2 * dt_s
            extra[2] = config.doubt_turn_std**2 * dt_s
        walk = np.array(
            [
                config.scale_walk**2 * length,
                config.turn_scale_walk**2 * turned,
                config.gyro_bias_walk**2 * dt_s,
            ]
        )
        # On the way the ranges change, and with them what their scale adds.
        bias_walk = config.range_bias_walk**2 * dt_s + (2.0 * config.range_scale_std) ** 2 * length
        way = swarm.way.then(errors, motion, variances, extra)
        twist = estimate.twist
        if dt_s > 0.0:
            twist = STANDING
            if not standing:
                turn_rate = (1.0 + errors[1]) * motion.turn_rad / dt_s - errors[2]
                twist = ((1.0 + errors[0]) * motion.distance_m / dt_s, float(turn_rate))
        return _estimate(stamp, swarm.after(way, walk, bias_walk), twist, estimate.memory)

    def _doubts(self, estimate: Estimate) -> bool:
        """Whether an anchor has read short for so long that the pose must be wrong."""
        if not estimate.memory or min(estimate.memory) > -self.config.doubt:
            return False
        variance = estimate.covariance
        return float(variance[0, 0] + variance[1, 1]) < self.config.doubt_limit**2

    def update(self, estimate: Estimate, measurement: Measurement) -> tuple[Estimate, Innovation]:
        """Return the estimate corrected by a range, pose or heading, and what happened."""
        if isinstance(measurement, RangeSample):
            after, found = self.update_ranges(estimate, (measurement,))
            return after, found[0]
        if isinstance(measurement, HeadingSample):
            return self._take(
                estimate, measurement, heading_sighting(measurement), self.config.heading_gate
            )
        return self._take(estimate, measurement, pose_sighting(measurement), self.config.pose_gate)

    def _take(
        self,
        estimate: Estimate,
        sample: PoseSample | HeadingSample,
        sighting: Sighting,
        gate: float,
    ) -> tuple[Estimate, Innovation]:
        swarm = _swarm(estimate)
        poses = swarm.now()
        view = view_of(swarm, poses, sighting)
        seen = foreseen(swarm, sighting, view)
        nis = float(seen.innovation @ np.linalg.solve(seen.spread, seen.innovation))
        accepted, reason, after = nis <= gate, 'beyond the gate', estimate
        if accepted:
            rng = self._random(sample.stamp, sample.source)
            settings = self.config.particles
            found = absorbed(swarm, poses, sighting, view, self._iteration, settings, rng)
            accepted, reason = found is not None, '' if found is not None else NO_PARTICLE
            if found is not None:
                after = _estimate(sample.stamp, found, estimate.twist, estimate.memory)
        return after, Innovation(
            sample.stamp,
            sample.source,
            '',
            accepted,
            reason,
            seen.innovation,
            seen.spread,
            nis,
            gate,
        )

    def update_ranges(
        self, estimate: Estimate, samples: Sequence[RangeSample]
    ) -> tuple[Estimate, tuple[Innovation, ...]]:
        """Return the estimate corrected by ranges of one instant, and what each of them did."""
        swarm = _swarm(estimate)
        poses = swarm.now()
        sighting = self._range_sighting(samples, estimate.twist)
        view = view_of(swarm, poses, sighting)
        seen = foreseen(swarm, sighting, view)
        judged = self._judge(estimate, swarm, samples, seen)
        used = np.flatnonzero(judged.accepted)
        accepted, reasons = judged.accepted, judged.reasons
        found: Swarm | None = swarm
        if len(used):
            if judged.forgotten:
                swarm = self._forget(swarm, judged.forgotten)
            if judged.forgotten or len(used) < len(samples):
                sighting = self._range_sighting([samples[int(i)] for i in used], estimate.twist)
                view = view_of(swarm, poses, sighting)
            noise = sighting.noise + np.diag(judged.extra[used])
            sighting = Sighting(sighting.look, noise, sighting.anchors)
            rng, settings = self._random(samples[0].stamp, RANGE_SOURCE), self.config.particles
            found = absorbed(swarm, poses, sighting, view, self._iteration, settings, rng)
        if found is None:
            accepted, reasons = (False,) * len(samples), (NO_PARTICLE,) * len(samples)
            found = swarm
        after = _estimate(estimate.stamp, found, estimate.twist, judged.memory)
        variances = np.diagonal(seen.spread)
        return after, tuple(
            Innovation(
                sample.stamp,
                RANGE_SOURCE,
                sample.anchor_id,
                accepted[row],
                reasons[row],
                seen.innovation[row : row + 1],
                variances[row : row + 1, None],
                float(seen.innovation[row] ** 2 / variances[row]),
                self.config.gate,
            )
            for row, sample in enumerate(samples)
        )

    def _range_sighting(
        self, samples: Sequence[RangeSample], twist: tuple[float, float]
    ) -> Sighting:
        found = [self._anchors[sample.anchor_id] for sample in samples]
        places = [anchor.position for _, anchor in found]
        measured = np.array(
            [s.range_m - anchor.bias_m for s, (_, anchor) in zip(samples, found, strict=True)]
        )
        lever_arm = self.lever_arm

        def look(poses: Matrix) -> tuple[Matrix, Array]:
            expected, slope = ranges_of(poses, places, lever_arm)
            return measured - expected, slope

        # A delay of the stamps that is not carried is noise, of the way driven in it.
        delayed = (self.config.range_delay_std * twist[0]) ** 2
        noise = np.diag([range_variance(self.config, sample) + delayed for sample in samples])
        return Sighting(look, noise, np.array([index for index, _ in found]))

    def _judge(
        self, estimate: Estimate, swarm: Swarm, samples: Sequence[RangeSample], seen: Seen
    ) -> _Judged:
        """Judge each range as the `ekf` does (there for the reasons)."""
        config, memory = self.config, list(estimate.memory)
        extra, reasons, accepted, forgotten = np.zeros(len(samples)), [], [], []
        for row, sample in enumerate(samples):
            index, _ = self._anchors[sample.anchor_id]
            spread = float(seen.spread[row, row])
            deviation = float(seen.innovation[row]) / math.sqrt(spread)
            persistent = memory[index]
            if persistent < -config.doubt and self._bias_of(swarm, index) > self._usual_bias:
                forgotten.append(index)
                memory[index] = 0.0
                extra[row] = self._usual_bias**2
                accepted.append(True)
                reasons.append(SHORT)
                continue
            clipped = min(max(deviation, -CLIP), CLIP)
            persistent += config.persistence_share * (clipped - persistent)
            memory[index] = persistent
            accepted.append(deviation * deviation <= config.gate)
            reason = '' if accepted[-1] else 'beyond the gate'
            if accepted[-1]:
                if abs(deviation) > config.huber:
                    extra[row] = spread * (abs(deviation) / config.huber - 1.0)
                    reason = 'weight reduced'
                if deviation > 0.0 and persistent > config.persistence:
                    extra[row] += spread * persistent**2 * config.persistence_count
                    reason = LONG
                elif persistent < -config.doubt:
                    reason = SHORT
            reasons.append(reason)
        return _Judged(extra, tuple(reasons), tuple(accepted), tuple(memory), tuple(forgotten))

    @staticmethod
    def _bias_of(swarm: Swarm, index: int) -> float:
        return float(np.exp(swarm.log_weights) @ swarm.biases[:, index])

    def _forget(self, swarm: Swarm, anchors: tuple[int, ...]) -> Swarm:
        """Return the swarm with the range biases of some anchors back at their prior."""
        biases, covariance = swarm.biases.copy(), swarm.bias_covariance.copy()
        for index in anchors:
            biases[:, index] = 0.0
            covariance[index] = covariance[:, index] = 0.0
            covariance[index, index] = self._usual_bias**2
        return Swarm(
            swarm.poses,
            swarm.errors,
            biases,
            swarm.log_weights,
            swarm.error_covariance,
            covariance,
            swarm.way,
        )

    def _random(self, stamp: int, source: str) -> np.random.Generator:
        key = (self.config.particles.seed, stamp, zlib.crc32(source.encode()))
        return np.random.default_rng(key)


class ParticleEkf(RobotParticleFilter):
    """Proposals by an EKF of each particle."""

    name = 'pf_ekf'


class ParticleIekf(RobotParticleFilter):
    """Proposals by an iterated EKF of each particle."""

    name = 'pf_iekf'


class ParticleUiekf(RobotParticleFilter):
    """Proposals by an IEKF with Levenberg-Marquardt damping of each particle."""

    name = 'pf_uiekf'


_USUAL_RANGE_M = 8.0


def pose_sighting(sample: PoseSample) -> Sighting:
    """Return how particles see a pose, or a position without heading."""
    rows = 3 if math.isfinite(sample.covariance[2, 2]) else 2
    place = np.array([sample.pose.x, sample.pose.y])

    def look(poses: Matrix) -> tuple[Matrix, Array]:
        expected, along = position_of(poses, sample.point)
        offset, slope = np.empty((len(poses), rows)), np.zeros((len(poses), rows, 3))
        offset[:, :2], slope[:, :2] = place - expected, along
        if rows == 3:
            offset[:, 2] = wrap(sample.pose.heading - poses[:, 2])
            slope[:, 2, 2] = 1.0
        return offset, slope

    return Sighting(look, sample.covariance[:rows, :rows])


def heading_sighting(sample: HeadingSample) -> Sighting:
    """Return how particles see a heading."""

    def look(poses: Matrix) -> tuple[Matrix, Array]:
        slope = np.zeros((len(poses), 1, 3))
        slope[:, 0, 2] = 1.0
        return wrap(sample.heading_rad - poses[:, 2:3]), slope

    return Sighting(look, np.array([[sample.variance]]))


def _swarm(estimate: Estimate) -> Swarm:
    if not isinstance(estimate.carried, Swarm):
        raise TypeError('an estimate without particles is none of a particle filter')
    return estimate.carried


def _estimate(
    stamp: int, swarm: Swarm, twist: tuple[float, float], memory: tuple[float, ...]
) -> Estimate:
    mean, covariance = swarm.moments(swarm.now())
    mean[2] = wrap(float(mean[2]))
    return Estimate(stamp, mean, covariance, twist, memory, swarm)
