"""What makes the workspace build again, and what it builds."""

from pathlib import Path

import pytest

from bootstrap.environment import Environment, _entries, _locked_names
from bootstrap.steps import outside_environment
from bootstrap.workspace import Workspace


@pytest.fixture
def root(tmp_path: Path) -> Path:
    for folder in ('uwb_driver', 'src/messages', 'tools/standins/tf2_msgs'):
        (tmp_path / folder).mkdir(parents=True)
        (tmp_path / folder / 'package.xml').write_text(f'<name>{folder}</name>')
    (tmp_path / 'src/messages/CMakeLists.txt').touch()
    (tmp_path / 'src/messages/msg').mkdir()
    (tmp_path / 'src/messages/msg/A.msg').write_text('int32 a')
    (tmp_path / 'uwb_driver/params').mkdir()
    (tmp_path / 'uwb_driver/params/a.yaml').write_text('a: 1')
    (tmp_path / 'uwb_driver/node.py').write_text('pass')
    (tmp_path / 'colcon.meta').write_text('{}')
    (tmp_path / 'requirements').mkdir()
    (tmp_path / 'requirements/lock.txt').write_text('a==1 \\\n    --hash=sha256:0\n')
    return tmp_path


def wanted(root: Path, ground: str = 'wheels x') -> dict[str, str]:
    workspace = Workspace(root)
    return workspace.wanted(ground, workspace.packages(''))


def test_packages_hold_standin_only_where_the_real_one_is_absent(root: Path) -> None:
    real = root / 'opt' / 'share' / 'tf2_msgs'
    real.mkdir(parents=True)
    (real / 'package.xml').touch()
    names = [path.name for path in Workspace(root).packages('')]
    assert names == ['messages', 'tf2_msgs', 'uwb_driver']
    names = [path.name for path in Workspace(root).packages(f'/none:{root / "opt"}')]
    assert names == ['messages', 'uwb_driver']


@pytest.mark.parametrize(
    'name', ['src/messages/msg/A.msg', 'uwb_driver/package.xml', 'colcon.meta']
)
def test_wanted_changes_with_what_is_built_from(root: Path, name: str) -> None:
    before = wanted(root)
    (root / name).write_text('changed')
    assert wanted(root) != before


def test_wanted_changes_only_for_the_package_that_changed(root: Path) -> None:
    before = wanted(root)
    (root / 'uwb_driver/setup.py').touch()
    after = wanted(root)
    assert {name for name in after if after[name] != before[name]} == {'uwb_driver'}


def test_wanted_changes_with_ground_and_with_new_shared_files(root: Path) -> None:
    before = wanted(root)
    assert wanted(root, 'wheels y') != before
    (root / 'uwb_driver/params/b.yaml').touch()
    assert wanted(root) != before


@pytest.mark.parametrize('name', ['uwb_driver/node.py', 'uwb_driver/params/a.yaml'])
def test_wanted_does_not_change_with_what_is_linked(root: Path, name: str) -> None:
    before = wanted(root)
    (root / name).write_text('changed')
    assert wanted(root) == before


def test_environment_changes_with_the_lock(root: Path) -> None:
    before = Environment(root).wanted()
    (root / 'requirements/lock.txt').write_text('a==2 \\\n    --hash=sha256:1\n')
    assert Environment(root).wanted() != before


def test_environment_without_stamp_is_not_current(root: Path) -> None:
    """As an interrupted set-up leaves it."""
    (root / '.venv/bin').mkdir(parents=True)
    (root / '.venv/bin/python3').touch()
    assert not Environment(root).is_current()


def test_outside_environment_forgets_this_checkout_only(tmp_path: Path) -> None:
    environ = {
        'PATH': f'{tmp_path}/.venv/bin:/usr/bin',
        'PYTHONPATH': f'{tmp_path}/build/a',
        'AMENT_PREFIX_PATH': f'/opt/ros/jazzy:{tmp_path}/install/a',
        'VIRTUAL_ENV': f'{tmp_path}/.venv',
        '_ROS_WHEELS_BOOTSTRAP_COMPLETE': '1',
        'HOME': '/home/someone',
    }
    outside = outside_environment(environ, tmp_path)
    assert outside['PATH'] == '/usr/bin'
    assert outside['AMENT_PREFIX_PATH'] == '/opt/ros/jazzy'
    assert outside['HOME'] == '/home/someone'
    assert not {'PYTHONPATH', 'VIRTUAL_ENV', '_ROS_WHEELS_BOOTSTRAP_COMPLETE'} & set(outside)


def test_entries_of_the_lock_keep_their_hashes() -> None:
    text = (
        '# head\na==1 \\\n    --hash=x \\\n    --hash=y\n'
        'b==2 ; python_version < "3" \\\n    --hash=z\n'
    )
    assert _entries(text, ('b',)) == 'b==2 ; python_version < "3" \\\n    --hash=z\n'
    assert _locked_names(text) == ['a', 'b']
