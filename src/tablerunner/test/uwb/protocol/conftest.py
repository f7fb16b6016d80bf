"""Lets the tests of this folder import what they share: writers of bytes and damage to them."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
