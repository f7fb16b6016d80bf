"""A device beside the executor, and how it does on /diagnostics."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence

from rclpy.node import Node

from tablerunner.errors import ConfigError
from tablerunner.types import RangeSample, Refusal
from tablerunner.uwb.device import Batch, DeviceConfig, DeviceReader, LinkState, build_session
from tablerunner_ros.diagnostics import ERROR, WARN, Report

Results = Sequence[RangeSample | Refusal]

_NUMBER = re.compile(r'\d+')

STILL_FACTOR = 1.5
"""Of the interval of a tag that stands still: silence up to this is no error."""


class DeviceInput:
    """Reads a device in a thread, from which its ranges leave; what follows is the executor's.

    Parameters
    ----------
    node : rclpy.node.Node
        Wakes for what comes.
    config : DeviceConfig
        `ConfigError` where it cannot be used.
    anchor_ids : sequence of str
        Names of the anchors in the map.
    publish : callable
        Called in the thread with what one read brought; returns what became of it.
    follow : callable
        Called in the executor's thread with that, a moment later.
    """

    def __init__(
        self,
        node: Node,
        config: DeviceConfig,
        anchor_ids: Sequence[str],
        publish: Callable[[Batch], Results],
        follow: Callable[[Results], None],
    ) -> None:
        try:
            self._session = build_session(config, anchor_ids)
        except ConfigError as error:
            raise error.located(f'parameters of {node.get_fully_qualified_name()}') from None
        self._device = f'{config.device} on {self._session.name}'
        self._follow = follow
        self._logger = node.get_logger()
        self._logged = ''
        guard = node.create_guard_condition(self._take)
        self._reader = DeviceReader(self._session, publish, guard.trigger)

    def start(self) -> None:
        """Begin to read."""
        self._reader.start()

    def stop(self) -> None:
        """End the reading; nothing is called any more."""
        self._reader.stop()

    @property
    def still_silence_s(self) -> float:
        """Silence that is to be expected of a tag that stands still [s]; 0: it says nothing."""
        interval_ms = self._session.health.facts.get('update_interval_still_ms', 0)
        return STILL_FACTOR * float(interval_ms) / 1000.0

    def describe(self, report: Report) -> None:
        """Add how the device does to a report, and log it when that has changed."""
        self._take()
        health = self._session.health
        report.values |= {
            'device': self._device,
            'device state': health.status,
            'device opened': str(health.opened),
            'device failures': str(health.failures),
            'device last failure': health.last_failure or 'none',
            'device bytes': str(health.bytes_read),
            'device frames': str(health.frames),
            'device stamps': health.stamps,
            **{f'device {name}': str(value) for name, value in health.facts.items()},
        }
        if self._reader.dropped:
            report.values['device reads dropped'] = str(self._reader.dropped)
        words = health.words
        if words:
            calm = health.link is LinkState.ENDED or (not health.failures and not health.trouble)
            report.add(WARN if calm else ERROR, f'{self._device}: {words}')
        told = _NUMBER.sub('', words)  # counting on is no news
        if told != self._logged:
            self._logged = told
            if words:
                self._logger.warning(f'{self._device}: {words}')
            else:
                self._logger.info(f'{self._device}: reads ranges')

    def _take(self) -> None:
        for results in self._reader.take():
            self._follow(results)
