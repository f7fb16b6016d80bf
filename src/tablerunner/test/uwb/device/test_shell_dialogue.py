"""The shell of an emulated DWM1001: opened, asked, lost, found again, and never switched off."""

import pytest
from bench_clock import Bench
from emulated import EmulatedDwm1001

from tablerunner.uwb.device.shell_dialogue import ShellDialogue
from tablerunner.uwb.protocol import Dwm1001Shell

ANCHORS = [
    (0x022E, (7.94, 8.03, 0.0), 3.44),
    (0x9280, (7.95, 0.0, 0.0), 5.68),
    (0xDCAE, (0.0, 8.03, 0.0), 7.76),
    (0x5431, (0.0, 0.0, 0.0), 8.73),
]
PLACE = (6.95, 5.37, -1.97)
TRUE = {(f'{address:04X}', metres) for address, _, metres in ANCHORS}


def shell(command='lec', module=None, **settings):
    """Return a bench with a module that nobody has spoken to yet."""
    module = module or EmulatedDwm1001(ANCHORS, PLACE)
    return Bench(module, Dwm1001Shell(), ShellDialogue(command, 'dwm1001'), **settings)


def found(ranges):
    """Return anchors and distances."""
    return {(item.anchor_id, item.range_m) for item in ranges}


@pytest.mark.parametrize('command', ['lec', 'les'])
def test_module_out_of_its_shell_is_brought_in_and_begun(command):
    """Within three seconds ranges come, at the module's rate, and facts of it are known."""
    bench = shell(command)
    bench.run(3.0)
    ranges, refusals = bench.run(10.0)
    assert len(ranges) == pytest.approx(400, abs=8)
    assert found(ranges) == TRUE
    assert not refusals
    assert bench.module.commands == [b'si', command.encode()]
    assert bench.health.facts['update_interval_still_ms'] == 10_000
    assert bench.health.facts['firmware'] == '01030001'
    assert bench.health.words == ''


def test_lines_that_are_on_already_are_only_listened_to():
    """A node that starts again must not switch the lines off: the same command ends them."""
    bench = shell()
    bench.run(3.0)
    again = shell(module=bench.module)
    again.module.shell, again.module.lines = True, b'lec'
    again.module.commands.clear()
    ranges, _ = again.run(5.0)
    assert len(ranges) >= 4 * 48
    assert again.module.commands == []


def test_tag_that_stands_still_is_left_alone():
    """A line every ten seconds, for five minutes: asked now and then, never switched off."""
    bench = shell()
    bench.run(3.0)
    bench.module.moves = False
    bench.module.commands.clear()
    ranges, refusals = bench.run(300.0)
    assert len(ranges) == pytest.approx(4 * 30, abs=8)
    assert not refusals
    assert set(bench.module.commands) == {b'si'}
    assert bench.source.opens == 1
    bench.module.moves = True
    bench.run(10.0)
    assert len(bench.run(5.0)[0]) == pytest.approx(200, abs=8)


def test_lines_switched_on_of_a_still_tag_are_waited_for():
    """Taken over in the shell, between two lines ten seconds apart: no command but si."""
    module = EmulatedDwm1001(ANCHORS, PLACE)
    bench = shell(module=module)
    module.shell, module.lines, module.moves = True, b'lec', False
    bench.run(1.0)
    module._next = bench.clock.now + 9.0
    ranges, _ = bench.run(40.0)
    assert len(ranges) >= 4 * 3
    assert set(module.commands) == {b'si'}


def test_open_shell_without_lines_is_begun():
    """Left in its shell by somebody else: after the interval of a still tag it is begun."""
    module = EmulatedDwm1001(ANCHORS, PLACE)
    bench = shell(module=module)
    module.shell = True
    ranges, _ = bench.run(20.0)
    assert found(ranges) == TRUE
    assert module.commands.count(b'lec') == 1


@pytest.mark.parametrize('still', [False, True])
def test_module_that_resets_is_begun_again(still):
    """Found out within seconds, also where lines are seldom."""
    bench = shell()
    bench.run(3.0)
    bench.module.moves = not still
    bench.run(12.0)
    bench.module.reset(bench.clock.now)
    bench.module.moves = True
    bench.run(15.0 if still else 6.0)
    ranges, _ = bench.run(2.0)
    assert len(ranges) >= 4 * 18
    assert found(ranges) == TRUE


def test_module_that_sleeps_loses_what_wakes_it():
    """The question and the first carriage return: the third is the second that it hears.

    Listening 0.5 s, the question 1 s, the returns 0.4 s: lines within 2.5 s.
    """
    module = EmulatedDwm1001(ANCHORS, PLACE)
    module.asleep = 2
    bench = shell(module=module)
    ranges, _ = bench.run(2.5)
    assert found(ranges) == TRUE


def test_module_that_answers_late_is_waited_for():
    """0.8 s for each answer: slower, but the same end."""
    bench = shell(latency_s=0.8)
    bench.run(10.0)
    ranges, _ = bench.run(5.0)
    assert len(ranges) == pytest.approx(200, abs=8)
    assert found(ranges) == TRUE


def test_deaf_module_is_told_of_and_tried_again():
    """Nothing comes: said within seconds, the port is opened anew, and it is found at last."""
    bench = shell()
    bench.module.deaf = True
    bench.run(6.0)
    assert 'does not open its shell' in bench.health.words
    bench.run(60.0)
    assert bench.health.opened > 2
    assert bench.health.failures == bench.health.opened - 1
    bench.module.deaf = False
    bench.run(15.0)
    assert found(bench.run(1.0)[0]) == TRUE
    assert bench.health.words == ''


def test_garbage_is_called_a_wrong_baud_rate():
    """A module whose every byte is changed: no range, and the baud rate is named."""
    bench = shell(garble=lambda data: [bytes(byte ^ 0x95 for byte in data)])
    bench.module.shell, bench.module.lines = True, b'lec'
    ranges, _ = bench.run(20.0)
    assert not ranges
    assert 'wrong baud rate' in bench.health.words
    assert bench.health.opened >= 2


def test_tag_out_of_its_network_is_told_of():
    """The shell answers, no lines come: the words say so; lines are taken when they come."""
    bench = shell()
    bench.module.in_network = False
    bench.run(60.0)
    assert bench.health.status == 'the shell answers, but the tag reports no ranges'
    bench.module.in_network = True
    bench.run(30.0)
    assert found(bench.run(2.0)[0]) == TRUE


def test_answers_cut_anywhere_are_understood():
    """Single bytes, one read each: prompts and lines are put together."""
    bench = shell(garble=lambda data: [data[at : at + 1] for at in range(len(data))])
    bench.run(3.0)
    ranges, refusals = bench.run(5.0)
    assert len(ranges) == pytest.approx(200, abs=8)
    assert not refusals
