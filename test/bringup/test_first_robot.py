"""docs/first-robot.md: its commands, all of them, in their order, on an emulated robot."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

from tablerunner_ros.testing.fixtures import domain
from tablerunner_ros.testing.process import environment
from tablerunner_ros.testing.waiting import wait_for

__all__ = ['domain']

pytestmark = pytest.mark.slow

PAGE = Path(__file__).parents[2] / 'docs' / 'first-robot.md'
LIMIT_S = 240.0
"""Of one step; ends a hang."""

LOST_LIMIT_S = 2.0
"""Of real time. The robot is late by a fifth of a second before any is lost at all, and stands for
stale poses and commands long before that: nothing can be said of a robot then."""

_MARK = re.compile(r'<!-- (run|stop)(?:: (.*?))? -->')


@dataclass(frozen=True)
class Step:
    """One marked block of the page.

    ``<!-- run: exit N expect "REGEX" -->`` before a block runs it and looks at exit code and
    output; ``tries N``: a busy machine may need more than one. With ``background NAME until
    "WORDS"`` it goes on running, until ``<!-- stop: NAME -->`` or the end of the page.
    """

    line: int
    script: str = ''
    exit_code: int = 0
    expect: str = ''
    background: str = ''
    until: str = ''
    tries: int = 1
    stop: str = ''


def steps_of(text: str) -> list[Step]:
    """Return the marked steps of a page, in their order."""
    lines = text.splitlines()
    found = []
    for number, line in enumerate(lines, 1):
        mark = _MARK.fullmatch(line.strip())
        if mark is None:
            continue
        kind, words = mark[1], mark[2] or ''
        if kind == 'stop':
            found.append(Step(number, stop=words))
            continue
        options = dict(re.findall(r'(exit|expect|background|until|tries) ("[^"]*"|\S+)', words))
        found.append(
            Step(
                number,
                script_after(lines, number),
                int(options.get('exit', 0)),
                options.get('expect', '').strip('"'),
                options.get('background', ''),
                options.get('until', '').strip('"'),
                int(options.get('tries', 1)),
            )
        )
    return found


def script_after(lines: list[str], start: int) -> str:
    """Return the indented block that follows."""
    script: list[str] = []
    for line in lines[start:]:
        if line.startswith('    '):
            script.append(line[4:])
        elif script:
            break
    return '\n'.join(script) + '\n'


class Day:
    """A shell in an empty folder, and what runs beside it."""

    def __init__(self, folder: Path, domain: int) -> None:
        self._folder = folder
        self._environment = environment(domain)
        self._running: dict[str, tuple[subprocess.Popen[bytes], Path]] = {}

    def do(self, step: Step) -> None:
        """Do one step; an AssertionError tells which line of the page failed, and how."""
        if step.stop:
            self.end(step.stop)
        elif step.background:
            self._start(step)
        else:
            self._run(step)

    def _run(self, step: Step) -> None:
        for _ in range(step.tries):
            fault = self._tried(step)
            if not fault:
                return
            print(fault)
        if self.lost_s > LOST_LIMIT_S:
            pytest.skip(f'no real time on this machine now: {self.lost_s:.0f} s lost; {fault}')
        raise AssertionError(fault)

    @property
    def lost_s(self) -> float:
        """Real time that the emulated robot could not keep up with."""
        if 'emulate' not in self._running:
            return 0.0
        text = self._running['emulate'][1].read_text('utf-8', 'replace')
        return float((re.findall(r'([\d.]+) s lost', text) or ['0'])[-1])

    def _tried(self, step: Step) -> str:
        """Return how a step failed; empty when it did not."""
        done = subprocess.run(
            ['bash', '-e', '-c', step.script],
            cwd=self._folder,
            env=self._environment,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            timeout=LIMIT_S,
            check=False,
        )
        said = done.stdout.decode('utf-8', 'replace')
        where = f'{PAGE.name}:{step.line}\n{step.script}\n{said}\n{self.said()}'
        if done.returncode != step.exit_code:
            return f'exit code {done.returncode}: {where}'
        return '' if re.search(step.expect, said) else f'{step.expect!r} not found: {where}'

    def _start(self, step: Step) -> None:
        log = self._folder / f'{step.background}.log'
        with log.open('wb') as file:
            process = subprocess.Popen(
                ['bash', '-c', f'exec {step.script}'],
                cwd=self._folder,
                env=self._environment,
                stdin=subprocess.DEVNULL,
                stdout=file,
                stderr=subprocess.STDOUT,
            )
        self._running[step.background] = (process, log)
        wait_for(
            lambda: step.until in log.read_text('utf-8', 'replace') or process.poll() is not None,
            f'{step.until!r} of {step.background}',
            LIMIT_S,
        )
        assert process.poll() is None, f'{PAGE.name}:{step.line} ended\n{self.said()}'

    def said(self) -> str:
        """Return what the running programs said."""
        return '\n'.join(
            f'--- {name}\n{log.read_text("utf-8", "replace")[-2000:]}'
            for name, (_, log) in self._running.items()
        )

    def end(self, name: str) -> None:
        """End a running program as Ctrl-C does."""
        process, _ = self._running[name]
        if process.poll() is None:
            process.send_signal(signal.SIGINT)
        assert process.wait(30.0) == 0, self.said()

    def close(self) -> None:
        """End all that still runs."""
        for process, _ in self._running.values():
            if process.poll() is None:
                process.send_signal(signal.SIGINT)
        for process, _ in self._running.values():
            try:
                process.wait(15.0)
            except subprocess.TimeoutExpired:
                process.kill()


@pytest.fixture
def day(tmp_path: Path, domain: int) -> Iterator[Day]:
    """Return a day in a folder and a domain of its own."""
    item = Day(tmp_path, domain)
    yield item
    item.close()


def test_first_robot_from_the_boxes_to_a_meal(day: Day) -> None:
    """Every command of the page, on a robot whose devices are emulated in real time."""
    steps = steps_of(PAGE.read_text(encoding='utf-8'))
    assert len(steps) >= 16
    for step in steps:
        begun = time.monotonic()
        day.do(step)
        words = step.script.splitlines()[:1] or [f'stop {step.stop}']
        print(f'{time.monotonic() - begun:6.1f} s  {words[0][:90]}')
    used = os.times()
    print(f'{used.children_user + used.children_system:.1f} s of processor time')


def test_every_block_of_commands_is_marked() -> None:
    """A command that is not run is one that nobody knows to work; only the set-up is not."""
    text = PAGE.read_text(encoding='utf-8')
    run = ''.join(step.script for step in steps_of(text))
    for line in re.findall(r'^    (tablerunner .*)$', text, re.MULTILINE):
        assert line in run, line
