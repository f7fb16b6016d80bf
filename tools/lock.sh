#!/usr/bin/env bash
# Pin every package of requirements/*.in, and what they need, in requirements/lock.txt: one file for
# all supported Pythons, with hashes. Meant for maintainers; needs the network.
set -euo pipefail

cd "$(dirname "$0")/../requirements"
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

"${PYTHON:-python3}" -m venv "$work/venv"
"$work/venv/bin/pip" --quiet install uv
# The environments that it resolves for are named in pyproject.toml, [tool.uv].
"$work/venv/bin/uv" --quiet pip compile --universal --python-version 3.10 --generate-hashes --upgrade \
  --no-header --no-annotate --no-emit-index-url --no-emit-find-links \
  runtime.in ros.in dev.in --output-file "$work/lock.txt"
{
  echo '# Written by `make lock` from the .in files beside it; do not edit.'
  echo '# CPython 3.10 to 3.14 on Linux, x86-64.'
  # The lock is for one system: what is left of the markers is the version of Python.
  sed -E "s/ and implementation_name == 'cpython'| and platform_machine == 'x86_64'| and sys_platform == 'linux'//g
          s/ and platform_python_implementation != 'PyPy'//
          s/(; | and )python_full_version < '3.15'//; s/ +\\\\$/ \\\\/" "$work/lock.txt"
} > lock.txt
