"""Every package declares what it imports: on a machine with ROS, rosdep installs only that."""

import ast
import sys
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest

ROOT = Path(__file__).parents[2]
PACKAGES = sorted(
    path.parent
    for path in [*ROOT.glob('*/package.xml'), *ROOT.glob('src/*/package.xml')]
    if (path.parent / 'setup.py').exists()
)
# Module -> rosdep key, where they differ.
KEYS = {
    'numpy': 'python3-numpy',
    'scipy': 'python3-scipy',
    'yaml': 'python3-yaml',
    'matplotlib': 'python3-matplotlib',
    'mpl_toolkits': 'python3-matplotlib',
    'rich': 'python3-rich',
    'typer': 'python3-typer',
    'psutil': 'python3-psutil',
    'filterpy': 'python3-filterpy-pip',
    'cv2': 'python3-opencv',
    'serial': 'python3-serial',
    'hypothesis': 'python3-hypothesis',
    'pytest': 'python3-pytest',
}
# Without a rosdep key: docs/install.md says how to install rosbags, which brings lz4; click comes
# with typer, the others are for Pythons that have no such module of their own.
WITHOUT_KEY = {'rosbags', 'lz4', 'backports', 'compression', 'click'}


def imported(package: Path) -> set[str]:
    names = set()
    for path in [*package.joinpath(package.name).rglob('*.py'), *package.glob('launch/*.py')]:
        for node in ast.walk(ast.parse(path.read_text(encoding='utf-8'))):
            if isinstance(node, ast.Import):
                names |= {alias.name.split('.')[0] for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
                names.add(node.module.split('.')[0])
    return names - set(sys.stdlib_module_names) - {package.name} - WITHOUT_KEY


@pytest.mark.parametrize('package', PACKAGES, ids=lambda path: path.name)
def test_package_declares_what_it_imports(package: Path) -> None:
    tree = ET.parse(package / 'package.xml')  # noqa: S314  # our own file
    declared = {
        element.text
        for tag in ('depend', 'exec_depend', 'test_depend')
        for element in tree.iter(tag)
    }
    needed = {KEYS.get(name, name) for name in imported(package)}
    assert needed <= declared
