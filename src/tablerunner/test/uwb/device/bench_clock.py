"""A session on an emulated module with a clock of its own: minutes pass in milliseconds."""

from tablerunner.uwb.device.config import ReconnectConfig
from tablerunner.uwb.device.range_maker import RangeMaker
from tablerunner.uwb.device.session import DeviceSession
from tablerunner.uwb.device.source import Arrival, Source, SourceError

EPOCH_NS = 1_700_000_000_000_000_000
STEP_S = 0.005


class Clock:
    """A time that passes only when somebody waits."""

    def __init__(self):
        self.now = 100.0

    def steady(self):
        return self.now

    def sleep(self, duration_s):
        self.now += duration_s

    def host_ns(self):
        return EPOCH_NS + round(self.now * 1e9)


class ModuleSource(Source):
    """A wire to an emulated module: answers after `latency_s`; `garble` changes what it says."""

    name = 'emulated'

    def __init__(self, module, clock, latency_s=0.002, garble=None):
        self.module, self.clock = module, clock
        self.latency_s, self.garble = latency_s, garble or (lambda data: [data])
        self.present = True
        self.opens = self.closes = 0
        self._coming = []  # (when, bytes)

    def open(self):
        self.opens += 1
        if not self.present:
            raise SourceError('emulated does not exist')
        self._coming = []

    def close(self):
        self.closes += 1

    def write(self, data):
        self._check()
        said = self.module.hear(data, self.clock.now)
        if said:
            self._coming.append((self.clock.now + self.latency_s, said))

    def read(self, wait_s):
        end = self.clock.now + wait_s
        while True:
            self._check()
            said = self.module.tick(self.clock.now)
            if said:
                self._coming.append((self.clock.now, said))
            due = [item for item in self._coming if item[0] <= self.clock.now]
            if due:
                self._coming = [item for item in self._coming if item[0] > self.clock.now]
                parts = self.garble(b''.join(data for _, data in due))
                return [Arrival(self.clock.host_ns(), part) for part in parts]
            if self.clock.now >= end:
                return []
            self.clock.now += min(STEP_S, end - self.clock.now)

    def _check(self):
        if not self.present:
            raise SourceError('emulated has gone')


class Bench:
    """A session, its module and its clock."""

    def __init__(self, module, parser, dialogue, names=None, **settings):
        self.clock = Clock()
        reconnect = settings.pop('reconnect', ReconnectConfig())
        module.reset(self.clock.now)
        self.module = module
        self.source = ModuleSource(module, self.clock, **settings)
        self.session = DeviceSession(
            self.source,
            parser,
            dialogue,
            RangeMaker(parser, names or {}),
            reconnect,
            steady=self.clock.steady,
        )

    def run(self, duration_s):
        """Step for a while; return ranges and refusals."""
        ranges, refusals = [], []
        end = self.clock.now + duration_s
        while self.clock.now < end:
            before = self.clock.now
            batch = self.session.step(0.1, self.clock.sleep)
            ranges += batch.ranges
            refusals += batch.refusals
            if self.clock.now == before:
                self.clock.now += 1e-4  # a step takes some time, too
        return ranges, refusals

    @property
    def health(self):
        return self.session.health
