"""Each check of the set-up on a machine that lacks what it looks for."""

import re
from collections.abc import Callable
from pathlib import Path

import pytest

from bootstrap import checks
from bootstrap.errors import SetupError


def without(*missing: str) -> Callable[[str], str | None]:
    return lambda name: None if name in missing else f'/usr/bin/{name}'


def unable(*missing: str) -> Callable[[str], object]:
    return lambda name: None if name in missing else object()


def message(check: Callable[..., object], *arguments: object, **named: object) -> str:
    with pytest.raises(SetupError) as caught:
        check(*arguments, **named)
    text = str(caught.value)
    assert '\n' not in text
    assert text.endswith('.')
    return text


@pytest.fixture
def header(tmp_path: Path) -> Path:
    path = tmp_path / 'Python.h'
    path.touch()
    return path


GLIBC = ('glibc', '2.36')


def test_system_supported_passes() -> None:
    checks.check_system('linux', 'x86_64', GLIBC)


@pytest.mark.parametrize('system', ['darwin', 'win32', 'freebsd14'])
def test_system_other_than_linux_is_named(system: str) -> None:
    assert f'this is {system}' in message(checks.check_system, system, 'x86_64', GLIBC)


def test_system_other_processor_points_to_ros() -> None:
    text = message(checks.check_system, 'linux', 'aarch64', GLIBC)
    assert 'this is aarch64' in text
    assert 'install ROS 2 Jazzy' in text


@pytest.mark.parametrize('libc', [('', ''), ('glibc', '2.27'), ('musl', '1.2')])
def test_system_old_or_other_libc_is_refused(libc: tuple[str, str]) -> None:
    assert 'glibc 2.28' in message(checks.check_system, 'linux', 'x86_64', libc)


def test_python_ordinary_passes() -> None:
    checks.check_python('CPython', False, 64)


@pytest.mark.parametrize(
    ('implementation', 'free_threaded', 'bits', 'kind'),
    [
        ('PyPy', False, 64, '64-bit PyPy'),
        ('CPython', True, 64, 'free-threaded CPython'),
        ('CPython', False, 32, '32-bit CPython'),
    ],
)
def test_python_of_another_kind_is_named(
    implementation: str, free_threaded: bool, bits: int, kind: str
) -> None:
    text = message(checks.check_python, implementation, free_threaded, bits)
    assert kind in text
    assert 'make PYTHON=' in text


@pytest.mark.parametrize('module', ['venv', 'ensurepip'])
def test_venv_missing_names_the_package(module: str) -> None:
    text = message(checks.check_venv, unable(module))
    assert re.search(r'apt install python3\.\d+-venv', text)


def test_compilers_present_pass(header: Path) -> None:
    checks.check_compilers(without(), {}, header)


@pytest.mark.parametrize(
    ('missing', 'words', 'package'),
    [
        (('cc', 'gcc', 'clang'), 'needs a C compiler, not found', 'build-essential'),
        (('c++', 'g++', 'clang++'), 'needs a C++ compiler, not found', 'build-essential'),
        (('cmake',), 'needs cmake, not found', 'apt install cmake'),
        (('make', 'gmake'), 'needs make, not found', 'build-essential'),
    ],
)
def test_compilers_missing_one_is_named(
    missing: tuple[str, ...], words: str, package: str, header: Path
) -> None:
    text = message(checks.check_compilers, without(*missing), {}, header)
    assert words in text
    assert package in text


def test_compilers_missing_all_are_named_at_once(tmp_path: Path) -> None:
    text = message(checks.check_compilers, lambda _: None, {}, tmp_path / 'Python.h')
    assert 'a C compiler, a C++ compiler, cmake, make and the header files of Python' in text
    assert text.count('build-essential') == 1


def test_compilers_named_in_environment_are_enough(header: Path) -> None:
    which = without('cc', 'gcc', 'clang', 'c++', 'g++', 'clang++')
    checks.check_compilers(which, {'CC': 'icx -O2', 'CXX': 'icpx'}, header)


def test_space_short_says_how_much(tmp_path: Path) -> None:
    text = message(checks.check_space, tmp_path, checks.GIGABYTE // 2)
    assert 'needs 2 GB' in text
    assert '0.5 GB free' in text


def test_ros_machine_not_sourced() -> None:
    assert not checks.is_ros_machine({}, unable('rclpy'))


def test_ros_machine_sourced() -> None:
    assert checks.is_ros_machine({'ROS_DISTRO': 'jazzy'}, unable())


def test_ros_machine_other_distribution_is_refused() -> None:
    text = message(checks.is_ros_machine, {'ROS_DISTRO': 'humble'}, unable())
    assert 'ROS humble is sourced' in text


def test_ros_machine_python_without_rclpy_is_refused() -> None:
    text = message(checks.is_ros_machine, {'ROS_DISTRO': 'jazzy'}, unable('rclpy'))
    assert 'cannot import rclpy' in text


def test_ros_machine_lists_missing_packages() -> None:
    text = message(checks.check_ros_machine, unable('rosbags', 'rich'), without())
    assert '(python3-rich, rosbags (pip))' in text


def test_ros_machine_without_colcon() -> None:
    assert 'colcon is missing' in message(checks.check_ros_machine, unable(), without('colcon'))
