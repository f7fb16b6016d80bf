"""Repair of the ROS 2 wheels: their CMake files name folders of the machine they come from."""

from __future__ import annotations

import re
from pathlib import Path

_PACKAGES = re.compile(r'/opt/python/cp\d+-cp\d+t?/lib/python\d+\.\d+t?/site-packages')
_HEADERS = re.compile(r'/opt/python/cp\d+-cp\d+t?/include/python\d+\.\d+t?')


def repair(share: Path, site_packages: Path, headers: Path) -> int:
    """Make every CMake file below `share` name this machine's folders; return how many changed.

    Parameters
    ----------
    share : Path
        The environment's share folder.
    site_packages : Path
        Where the environment's Python packages are (NumPy's headers are looked for there).
    headers : Path
        The folder with Python.h.
    """
    changed = 0
    for path in sorted(share.rglob('*.cmake')):
        before = path.read_text(encoding='utf-8', errors='surrogateescape')
        after = _PACKAGES.sub(lambda _: str(site_packages), before)
        after = _HEADERS.sub(lambda _: str(headers), after)
        if after != before:
            path.write_text(after, encoding='utf-8', errors='surrogateescape')
            changed += 1
    return changed
