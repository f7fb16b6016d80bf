"""The wheels' CMake files are made to name this machine's folders."""

from pathlib import Path

from bootstrap import wheels


def test_repair_replaces_both_folders_and_nothing_else(tmp_path: Path) -> None:
    path = tmp_path / 'std_msgs' / 'cmake' / 'export.cmake'
    path.parent.mkdir(parents=True)
    path.write_text(
        '"/opt/python/cp311-cp311/lib/python3.11/site-packages/numpy/_core/include;'
        '/opt/python/cp313-cp313/include/python3.13;/opt/other"'
    )
    untouched = tmp_path / 'other.cmake'
    untouched.write_text('set(X "/opt/ros")')
    count = wheels.repair(tmp_path, Path('/venv/site-packages'), Path('/usr/include/python3.11'))
    assert count == 1
    assert path.read_text() == (
        '"/venv/site-packages/numpy/_core/include;/usr/include/python3.11;/opt/other"'
    )
    assert untouched.read_text() == 'set(X "/opt/ros")'


def test_repair_twice_changes_nothing_more(tmp_path: Path) -> None:
    (tmp_path / 'a.cmake').write_text('/opt/python/cp310-cp310/include/python3.10')
    assert wheels.repair(tmp_path, Path('/s'), Path('/h')) == 1
    assert wheels.repair(tmp_path, Path('/s'), Path('/h')) == 0
