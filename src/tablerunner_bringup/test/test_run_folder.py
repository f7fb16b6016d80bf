"""Folders of runs."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from tablerunner.errors import ConfigError
from tablerunner_bringup.executables import ExecutableError, find_executable
from tablerunner_bringup.nodes import NODES
from tablerunner_bringup.run_folder import RunFolder


def test_run_folder_many_at_once_are_all_different(tmp_path):
    """Runs that start within one second do not share a folder."""
    with ThreadPoolExecutor(8) as pool:
        folders = list(pool.map(lambda _: RunFolder.new(tmp_path, 'room'), range(16)))
    assert len({folder.path for folder in folders}) == 16


def test_run_folder_holds_the_scenario(tmp_path):
    """Whoever reads the bag finds the room beside it."""
    scenario = tmp_path / 'room.yaml'
    scenario.write_text('name: room\n', encoding='utf-8')
    folder = RunFolder(tmp_path / 'run').prepare(scenario)
    assert (folder.path / 'scenario.yaml').read_text(encoding='utf-8') == 'name: room\n'
    assert folder.log('sim_bridge') == folder.path / 'logs' / 'sim_bridge.log'
    assert folder.logs.is_dir()


def test_run_folder_clear_keeps_what_is_not_its_own(tmp_path):
    """A second demo begins clean, and a folder that a user names keeps the user's files."""
    scenario = tmp_path / 'scenario_of_user.yaml'
    scenario.write_text('name: room\n', encoding='utf-8')
    folder = RunFolder(tmp_path).prepare(scenario)
    folder.bag.mkdir()
    for file in (folder.bag / 'bag.mcap', folder.errors, folder.picture, folder.log('node')):
        file.write_text('old', encoding='utf-8')
    folder.clear()
    assert list(tmp_path.iterdir()) == [scenario]
    folder.clear()


def test_run_folder_unwritable_place_is_refused(tmp_path):
    """A file in the folder's place is said in one line."""
    (tmp_path / 'file').write_text('', encoding='utf-8')
    scenario = tmp_path / 'file'
    with pytest.raises(ConfigError, match='a folder that can be written'):
        RunFolder(tmp_path / 'file').prepare(scenario)
    with pytest.raises(ConfigError, match='a folder that can be written'):
        RunFolder.new(tmp_path / 'file', 'room')


def test_find_executable_every_node_is_installed():
    """Each node of the list is where `ros2 run` would find it."""
    for spec in NODES:
        assert find_executable(spec.package, spec.executable).name == spec.executable


def test_find_executable_first_prefix_wins(tmp_path):
    """An overlay goes before what lies below it."""
    for name in ('overlay', 'underlay'):
        path = tmp_path / name / 'lib' / 'package' / 'node'
        path.parent.mkdir(parents=True)
        path.write_text('', encoding='utf-8')
        path.chmod(0o755)
    among = (tmp_path / 'nothing', tmp_path / 'overlay', tmp_path / 'underlay')
    assert find_executable('package', 'node', among).parts[-4] == 'overlay'


@pytest.mark.parametrize(
    ('built', 'words'), [(False, 'is not built'), (True, 'has no executable')]
)
def test_find_executable_missing_says_what_to_do(tmp_path, built, words):
    """It is told apart whether the package or only its program is missing."""
    if built:
        share = tmp_path / 'share' / 'package'
        share.mkdir(parents=True)
        (share / 'package.xml').write_text('', encoding='utf-8')
    with pytest.raises(ExecutableError, match=words):
        find_executable('package', 'node', (tmp_path,))


def test_find_executable_no_environment_says_so(monkeypatch):
    """Outside the environment the message names env.sh."""
    monkeypatch.delenv('AMENT_PREFIX_PATH')
    with pytest.raises(ExecutableError, match=r'env\.sh'):
        find_executable('package', 'node')


def test_scenarios_are_installed():
    """The default scenario is among the share files."""
    from tablerunner_bringup.launching import default_scenario

    assert Path(default_scenario()).is_file()
