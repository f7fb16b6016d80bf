"""A small rule base with a bell, a rule that leaves an input open, and unequal sets."""

from __future__ import annotations

import pytest

TEXT = """\
title: how hard to brake
inputs:
  distance:
    unit: m
    domain: [0.0, 10.0]
    sets:
      near: {left_shoulder: [1.0, 4.0]}
      middle: {triangle: [1.0, 4.0, 8.0]}
      far: {right_shoulder: [4.0, 8.0]}
  speed:
    domain: [0.0, 2.0]
    sets:
      slow: {gaussian: [0.0, 0.6]}
      fast: {trapezoid: [0.2, 1.2, 3.0, 4.0]}
output:
  brake:
    unit: '%'
    domain: [0.0, 100.0]
    sets:
      none: {left_shoulder: [0.0, 40.0]}
      some: {triangle: [0.0, 40.0, 90.0]}
      full: {right_shoulder: [60.0, 90.0]}
tables:
  - name: first
    rows: distance
    columns: speed
    order: [slow, fast]
    cells:
      near: [some, full]
      middle: [none, some]
rules:
  - when: {distance: far}
    then: none
"""


@pytest.fixture
def text() -> str:
    return TEXT
