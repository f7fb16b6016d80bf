"""Do the parameters fit the robot, and do all anchors answer."""

from __future__ import annotations

import math
import statistics
from collections.abc import Iterator, Sequence

import numpy as np

from tablerunner.doctor.facts import Facts
from tablerunner.doctor.finding import Finding, error, ok, warning

PARAMETERS, ANCHORS, DIAGNOSTICS = 'parameters', 'anchors', 'diagnostics'

LEAST_ANCHORS = 3
LEAST_SPREAD_M = 0.5
"""RMS distance of the anchors from their best line: nearer to one line, the side is open."""

_SAME_HEIGHT_M = 0.05
_FEW = 0.3
_MOSTLY = 0.8


def check_parameters(facts: Facts) -> Iterator[Finding]:
    """Yield whether what was measured of the room and of the robot was told to the nodes."""
    yield from _anchor_places(facts)
    yield from _heights(facts)
    yield from _joints(facts)


def _anchor_places(facts: Facts) -> Iterator[Finding]:
    if 'uwb_driver' not in facts.parameters:
        return
    names = tuple(facts.parameter('uwb_driver', 'anchor_ids', ()))
    numbers = tuple(facts.parameter('uwb_driver', 'anchor_positions', ()))
    advice = 'measure where they hang (or: tablerunner survey-anchors), and write anchor_ids and '
    advice += 'anchor_positions of uwb_driver into robot.yaml'
    if len(names) < LEAST_ANCHORS:
        words = 'no anchors are told' if not names else f'only {len(names)} anchors are told'
        found = f'{words}: a position needs {LEAST_ANCHORS}, better four'
        yield error(PARAMETERS, 'anchor_ids', found, advice)
        return
    spread = spread_m(numbers)
    if spread < LEAST_SPREAD_M:
        yield error(
            PARAMETERS,
            'anchor_positions',
            f'the anchors hang in one line, {spread:.2f} m from it: both sides of it look alike',
            'hang one of them aside, by metres',
        )
        return
    yield ok(PARAMETERS, 'anchor_ids', f'{len(names)} anchors: {", ".join(map(str, names))}')


def spread_m(positions: Sequence[float]) -> float:
    """Return the RMS distance of places from the line through them that fits best, from above.

    `positions` holds x, y, z of each, one after the other [m].
    """
    places = np.asarray(positions, dtype=np.float64).reshape(-1, 3)[:, :2]
    if len(places) < 2:
        return 0.0
    values = np.linalg.svd(places - places.mean(axis=0), compute_uv=False)
    return float(values[-1] / math.sqrt(len(places)))


def _heights(facts: Facts) -> Iterator[Finding]:
    height = facts.parameter('uwb_driver', 'tag_height', None)
    place = facts.parameter('fusion_node', 'tag_position', None)
    if height is None or place is None:
        return
    if abs(height - place[2]) > _SAME_HEIGHT_M:
        yield warning(
            PARAMETERS,
            'tag_height',
            f'uwb_driver says {height:g} m, tag_position of fusion_node {place[2]:g} m',
            'measure the height of the tag antenna over the floor and tell it to both',
        )
    else:
        yield ok(PARAMETERS, 'tag_height', f'{height:g} m')


def _joints(facts: Facts) -> Iterator[Finding]:
    wanted = [
        str(joint)
        for side in ('left_joints', 'right_joints')
        for joint in facts.parameter('odom_node', side, ())
    ]
    seen = facts.topic('joint_states').names
    if not wanted or not seen:
        return
    missing = [joint for joint in wanted if joint not in seen]
    if missing:
        yield error(
            PARAMETERS,
            'left_joints, right_joints',
            f'{", ".join(missing)} not in joint_states, which has {", ".join(seen)}',
            'name the drive wheels as joint_states does, in left_joints and right_joints of '
            'odom_node',
        )
    else:
        yield ok(PARAMETERS, 'left_joints, right_joints', ', '.join(wanted))


def check_anchors(facts: Facts) -> Iterator[Finding]:
    """Yield whether each anchor that was told is heard, and no other."""
    told = [str(name) for name in facts.parameter('uwb_driver', 'anchor_ids', ())]
    heard = facts.anchors
    if told and not heard:
        yield error(
            ANCHORS,
            'all',
            'no anchor is heard',
            'power of the anchors; the tag and its cable; device and port of uwb_driver; the same '
            'channel, network id and firmware in all modules',
        )
        return
    usual = statistics.median(item.count for item in heard.values()) if heard else 0.0
    for name in told:
        found = heard.get(name)
        if found is None:
            yield error(
                ANCHORS,
                name,
                f'not heard for {facts.duration_s:.0f} s',
                'its power; its id as the module says it (anchor_ids of uwb_driver); is it in '
                'reach: go nearer with the tag',
            )
        elif found.count < _FEW * usual:
            yield warning(
                ANCHORS,
                name,
                f'{found.count} ranges, the others about {usual:.0f}',
                'turn its antenna, hang it higher, look for metal in between',
            )
        elif found.nlos_share > _MOSTLY:
            yield warning(
                ANCHORS,
                name,
                f'{100.0 * found.nlos_share:.0f} % of its ranges came round an obstacle',
                'hang it where the tag sees it: above heads, away from walls and metal',
            )
        else:
            yield ok(ANCHORS, name, f'{found.count / facts.duration_s:.1f} ranges a second')
    for name in [*sorted(set(heard) - set(told)), *_unknown(facts)]:
        if told or name in heard:
            yield warning(
                ANCHORS,
                name,
                'heard, but nobody said where it hangs',
                'add it to anchor_ids and anchor_positions of uwb_driver, or switch it off',
            )


def _unknown(facts: Facts) -> list[str]:
    """Return the anchors that uwb_driver refuses because it was not told of them."""
    begin = 'refused: unknown anchor ('
    found = {
        key.removeprefix(begin).rstrip(')')
        for status in facts.statuses
        if status.name.startswith('uwb_driver')
        for key in status.values
        if key.startswith(begin)
    }
    return sorted(found - set(facts.anchors))


def check_diagnostics(facts: Facts) -> Iterator[Finding]:
    """Yield what the nodes themselves say."""
    for status in sorted(facts.statuses, key=lambda item: item.name):
        if status.level == 0:
            yield ok(DIAGNOSTICS, status.name, status.message or 'ok')
            continue
        node = status.name.partition(':')[0]
        advice = f'docs/nodes.md, section {node}, says what each reason means'
        make = warning if status.level == 1 else error
        yield make(DIAGNOSTICS, status.name, status.message or 'not ok', advice)
