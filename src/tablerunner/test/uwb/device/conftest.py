"""Lets the tests of this folder import what they share: writers of bytes, emulated devices."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
sys.path.insert(0, str(Path(__file__).parents[1] / 'protocol'))
