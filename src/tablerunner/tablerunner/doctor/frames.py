"""Is the tree of frames whole: map to odom to base_link to each sensor."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

from tablerunner.doctor.facts import Facts
from tablerunner.doctor.finding import Finding, error, ok, warning
from tablerunner.geometry.frame_tree import FrameTree

FRAMES = 'frames'

STALE_S = 1.0
"""A transform that moves is older than this when its publisher is gone."""

_SAME_M = 0.02
_SENSORS = {'imu/data': 'the IMU', 'uwb/ranges': 'the tag'}


def check_frames(facts: Facts) -> Iterator[Finding]:
    """Yield whether each frame that is needed hangs in the tree."""
    tree = FrameTree()
    for item in facts.links:
        tree.add(item.link)
    names = {
        name: str(facts.parameter('fusion_node', f'{name}_frame', default))
        for name, default in (('map', 'map'), ('odom', 'odom'), ('base', 'base_link'))
    }
    yield from _parents(facts)
    yield from _step(facts, tree, names, 'odom', 'base')
    yield from _step(facts, tree, names, 'map', 'odom')
    yield from _sensors(facts, tree, names['base'])
    yield from _tag(facts, tree, names['base'])


def _parents(facts: Facts) -> Iterator[Finding]:
    """Yield frames with two parents: tf keeps the one that came last, and jumps between them."""
    parents: dict[str, set[str]] = {}
    for item in facts.links:
        parents.setdefault(item.link.child, set()).add(item.link.parent)
    for child, found in sorted(parents.items()):
        if len(found) > 1:
            yield error(
                FRAMES,
                child,
                f'hangs in {" and in ".join(sorted(found))}',
                'a frame has one parent: switch one publisher off (publish_tf of our nodes, '
                'enable_odom_tf of diff_drive_controller)',
            )


def _step(
    facts: Facts, tree: FrameTree, names: Mapping[str, str], parent: str, child: str
) -> Iterator[Finding]:
    upper, lower = names[parent], names[child]
    subject = f'{upper} -> {lower}'
    chain = tree.chain(upper, lower)
    if chain is None:
        yield error(FRAMES, subject, 'missing', _missing(facts, parent, lower))
        return
    ages = [item.age_s for item in facts.links if item.link in chain and not item.static]
    if ages and max(ages) > STALE_S:
        advice = 'its publisher has gone silent: see topics and diagnostics'
        yield error(FRAMES, subject, f'{max(ages):.1f} s old', advice)
    else:
        yield ok(FRAMES, subject, 'there')


def _missing(facts: Facts, parent: str, child: str) -> str:
    if parent == 'odom':
        return (
            'odom_node publishes it for each joint_states that it accepts (publish_tf: true); '
            'with --odom-topic the base has to (enable_odom_tf: true)'
        )
    state = next((item for item in facts.statuses if item.name == 'fusion_node'), None)
    told = '' if state is None else state.values.get('state', '')
    if told == 'aligning':
        return (
            'fusion_node does not know its heading yet: drive a few metres in a curve, or give '
            'the pose (RViz: 2D Pose Estimate; initial_pose of fusion_node; the service set_pose)'
        )
    words = f' ({state.message})' if state is not None and state.message else ''
    return f'fusion_node publishes it once it knows where the robot is{words}: see {child}, ranges'


def _sensors(facts: Facts, tree: FrameTree, base: str) -> Iterator[Finding]:
    wanted = {
        frame: _SENSORS.get(name, name)
        for name, topic in facts.topics.items()
        if name in _SENSORS or name.startswith('ultrasonic/')
        for frame in topic.frames
    }
    for frame, what in sorted(wanted.items()):
        if tree.chain(base, frame) is not None:
            yield ok(FRAMES, f'{base} -> {frame}', 'there')
            continue
        empty = frame == ''
        yield warning(
            FRAMES,
            f'{base} -> {frame or "(no name)"}',
            f'{what} gives no frame' if empty else f'missing; it is the frame of {what}',
            'let its driver fill header.frame_id'
            if empty
            else 'put it into the URDF, or into frames and poses of sensor_frames: RViz cannot '
            'show the sensor without it',
        )


def _tag(facts: Facts, tree: FrameTree, base: str) -> Iterator[Finding]:
    """Yield whether tf and the parameter of fusion_node agree on where the tag is."""
    place = facts.parameter('fusion_node', 'tag_position', None)
    for frame in facts.topic('uwb/ranges').frames:
        chain = tree.chain(base, frame)
        if place is None or chain is None or len(chain) != 1:
            continue
        apart = math.dist(place, chain[0].translation)
        if apart > _SAME_M:
            told = ', '.join(f'{number:g}' for number in place)
            seen = ', '.join(f'{number:g}' for number in chain[0].translation)
            yield warning(
                FRAMES,
                frame,
                f'tf has it at {seen}, tag_position of fusion_node at {told}',
                'measure once more and correct the wrong one: fusion_node goes by tag_position',
            )
