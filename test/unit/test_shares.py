"""How the tests are shared out among workers: ../../conftest.py."""

from __future__ import annotations

from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


@pytest.fixture
def shares(pytestconfig):
    """Return the module at the root."""
    return next(
        plugin
        for plugin in pytestconfig.pluginmanager.get_plugins()
        if getattr(plugin, '__file__', None) == str(ROOT / 'conftest.py')
    )


def test_paths_that_are_named_exist(shares):
    """A folder that moves would lose its place without a word."""
    for path in (shares.CORE, *shares.FIRST, *shares.ONE_BY_ONE, *shares.TOGETHER):
        assert (ROOT / path).exists(), path


def test_module_stays_together_and_long_tests_stand_alone(shares):
    """Fixtures of a module are made once; those of a recording for both its modules."""
    core = ['src/tablerunner/test/test_a.py::test_b', 'src/tablerunner/test/test_a.py::test_c[1]']
    assert {shares.share_of(test) for test in core} == {'src/tablerunner/test/test_a.py'}
    assert len({shares.share_of(f'{path}::test') for path in shares.TOGETHER}) == 1
    launched = [f'test/bringup/test_failures.py::test_run[{name}]' for name in 'ab']
    assert [shares.share_of(test) for test in launched] == launched


def test_core_comes_first_for_one_worker_and_last_for_the_others(shares):
    tests = ['tools/test/test_a.py', 'src/tablerunner/test/test_a.py', 'test/bringup/a.py::b']
    computing = sorted(tests, key=lambda share: shares.turn_of(share, True))
    waiting = sorted(tests, key=lambda share: shares.turn_of(share, False))
    assert computing == [tests[1], tests[2], tests[0]]
    assert waiting == [tests[2], tests[0], tests[1]]
