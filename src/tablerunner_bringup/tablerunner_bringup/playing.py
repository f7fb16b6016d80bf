"""`tablerunner play`: publish a bag."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from tablerunner.bags.reader import BagReader
from tablerunner.cli.console import Progress
from tablerunner.errors import BagError
from tablerunner_bringup.interrupts import Interrupts
from tablerunner_bringup.message_types import MessageTypeError, message_class
from tablerunner_bringup.player import Message, Pace, Player, Track
from tablerunner_bringup.polling import bare_node
from tablerunner_bringup.qos_matching import offered_profiles
from tablerunner_bringup.recorder import Selection


@dataclass(frozen=True)
class PlayOptions:
    """What of a bag to play, and how."""

    bag: Path
    pace: Pace = field(default_factory=Pace)
    selection: Selection = field(default_factory=lambda: Selection(hidden=True))
    wait_for: tuple[str, ...] = ()
    wait_limit_s: float = 30.0
    loop: bool = False
    domain: int | None = None


def play(options: PlayOptions, progress: Progress) -> int:
    """Play a bag until its end or a signal; return the number of messages published.

    Raises
    ------
    BagError
        There is no such bag, or nothing in it that can be played.
    PlayError
        Nobody listens who should.
    """
    with Interrupts() as interrupts, BagReader(options.bag) as bag, progress:
        for damage in bag.damage:
            progress.say(f'damaged: {damage}', 'yellow')
        tracks = _tracks(bag, options.selection, progress)
        duration_s = (bag.end - bag.start) * 1e-9
        if options.pace.start_s > duration_s:
            raise BagError(
                f'{options.bag} is {duration_s:.1f} s long: '
                f'it cannot be played from second {options.pace.start_s:g}'
            )
        with bare_node('tablerunner_player', options.domain) as node:
            player = Player(node, tracks, options.pace)
            progress.say(f'waiting for subscribers of {len(player.topics)} topics')
            unserved = player.wait_for_listeners(
                options.wait_for, options.wait_limit_s, lambda: interrupts.asked
            )
            for topic in unserved:
                progress.say(
                    f'{topic}: a subscriber asks for a quality of service that was not recorded',
                    'yellow',
                )
            progress.say(f'playing {options.bag}: {duration_s:.1f} s')
            while not interrupts.asked:
                player.play(
                    _messages(bag, {track.topic for track in tracks}, options.pace.clock),
                    lambda: interrupts.asked,
                    lambda elapsed_s: progress.show(
                        f'{elapsed_s + options.pace.start_s:7.1f} of {duration_s:.1f} s'
                    ),
                )
                if not options.loop:
                    break
            if player.late_s > 0.1:
                progress.say(f'up to {player.late_s:.1f} s late: the rate is too high here')
            return sum(player.counts.values())


def _tracks(bag: BagReader, selection: Selection, progress: Progress) -> list[Track]:
    tracks = []
    for topic in bag.topics:
        if not selection.takes(topic.name) or not topic.count:
            continue
        try:
            message_class(topic.msgtype)
        except MessageTypeError as error:
            progress.say(f'{topic.name} is left out: {error}', 'yellow')
            continue
        tracks.append(Track(topic.name, topic.msgtype, offered_profiles(topic.qos), topic.count))
    if not tracks:
        raise BagError(f'{bag.path} holds nothing to play')
    return tracks


def _messages(bag: BagReader, topics: set[str], clock: bool) -> Iterator[Message]:
    # Messages of other topics still move the clock, so that it does not depend on the choice.
    for raw in bag.raw(None if clock else topics):
        yield Message(raw.stamp, raw.topic, raw.data)
