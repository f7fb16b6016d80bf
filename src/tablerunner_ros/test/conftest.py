"""Settings of the property tests of this package."""

from __future__ import annotations

from hypothesis import settings

# Conversions have no rare branches: a few dozen examples show what there is. A deadline would
# measure how busy the machine is.
settings.register_profile('tablerunner_ros', max_examples=40, deadline=None)
settings.load_profile('tablerunner_ros')
