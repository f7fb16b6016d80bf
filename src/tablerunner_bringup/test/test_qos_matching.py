"""What a recorder asks for and a player offers."""

from __future__ import annotations

import pytest
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

from tablerunner.bags.writer import BagWriter
from tablerunner_bringup.qos_matching import (
    offered_profiles,
    publisher_profile,
    recorded_quality,
    subscription_profile,
)
from tablerunner_bringup.recorder import Selection

RELIABLE = QoSProfile(depth=10)
SENSOR = QoSProfile(depth=5, reliability=ReliabilityPolicy.BEST_EFFORT)
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


@pytest.mark.parametrize(
    ('offered', 'reliable', 'latched'),
    [
        ([RELIABLE], True, False),
        ([SENSOR], False, False),
        ([LATCHED, LATCHED], True, True),
        ([RELIABLE, SENSOR], False, False),
        ([LATCHED, RELIABLE], True, False),
    ],
)
def test_subscription_profile_asks_for_what_all_offer(offered, reliable, latched):
    """Asking one publisher for more than it offers would lose all of it."""
    profile = subscription_profile(offered)
    assert (profile.reliability == ReliabilityPolicy.RELIABLE) is reliable
    assert (profile.durability == DurabilityPolicy.TRANSIENT_LOCAL) is latched
    assert profile.depth >= 100


def test_publisher_profile_reliable_keeps_everything():
    """A reliable message is not overwritten before it was acknowledged."""
    profile = publisher_profile([RELIABLE], 5000)
    assert profile.history == HistoryPolicy.KEEP_ALL
    assert profile.reliability == ReliabilityPolicy.RELIABLE


def test_publisher_profile_latched_keeps_every_message_of_the_topic():
    """Static transforms of several publishers come from one player."""
    profile = publisher_profile([LATCHED], 7)
    assert profile.durability == DurabilityPolicy.TRANSIENT_LOCAL
    assert profile.depth == 7


def test_publisher_profile_unknown_serves_ordinary_subscribers():
    """A bag that says nothing of quality is played reliable and volatile."""
    profile = publisher_profile([], 10)
    assert profile.reliability == ReliabilityPolicy.RELIABLE
    assert profile.durability == DurabilityPolicy.VOLATILE


@pytest.mark.parametrize('storage', ['mcap', 'sqlite3'])
@pytest.mark.parametrize('offered', [RELIABLE, SENSOR, LATCHED])
def test_quality_survives_the_bag(tmp_path, storage, offered):
    """What the recorder stores is what the player reads."""
    from tablerunner.bags.reader import BagReader

    with BagWriter(tmp_path / 'bag', storage) as bag:
        bag.add_topic('/odom', 'nav_msgs/msg/Odometry', recorded_quality([offered]))
    with BagReader(tmp_path / 'bag') as bag:
        (topic,) = bag.topics
    (found,) = offered_profiles(topic.qos)
    assert (found.reliability, found.durability, found.depth) == (
        offered.reliability,
        offered.durability,
        offered.depth,
    )


@pytest.mark.parametrize(
    'text', ['', 'not: [a list', 'a: 1', '- 3', '- {reliability: strange, depth: many}']
)
def test_offered_profiles_strange_text_is_no_error(text):
    """A foreign or damaged bag is played all the same."""
    for profile in offered_profiles(text):
        assert profile.reliability == ReliabilityPolicy.BEST_EFFORT


def test_offered_profiles_words_and_numbers_mean_the_same():
    """Rosbag2 wrote numbers up to version 8 and words since."""
    words = '- {reliability: reliable, durability: transient_local, depth: 1}'
    numbers = '- {reliability: 1, durability: 1, depth: 1}'
    assert offered_profiles(words) == offered_profiles(numbers)


@pytest.mark.parametrize(
    ('selection', 'taken', 'left'),
    [
        (
            Selection(),
            ['/odom', '/camera/image_raw'],
            ['/deliver/_action/feedback', '/camera/debug_image'],
        ),
        (Selection(('/camera/*',)), ['/camera/debug_image'], ['/odom']),
        (Selection(hidden=True), ['/deliver/_action/feedback'], []),
        (Selection(['/uwb/*']), ['/uwb/ranges'], ['/odom', '/uwb']),
        (Selection(['/deliver/_action/*']), ['/deliver/_action/status'], ['/odom']),
        (Selection(['/odom']), ['/odom'], ['/odom2', '/robot/odom']),
    ],
)
def test_selection_takes_what_was_asked_for(selection, taken, left):
    """Hidden topics only where they are named or all are asked for."""
    assert all(selection.takes(topic) for topic in taken)
    assert not any(selection.takes(topic) for topic in left)
