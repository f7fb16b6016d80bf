"""Which of a device's ranges does not fit the place that the device itself found from them.

Protocols without a checksum let a lost or changed digit through. Damage comes to one place of a
frame: so exactly one range disagrees while the others and the position agree. Where several
disagree, the position is to blame, or the anchors stand elsewhere than the device was told; then
nothing can be said.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from tablerunner.uwb.protocol.record import DeviceRange, Place

LEAST_RANGES = 3
"""With fewer, a place does not follow from ranges."""

ODD_RANGE = 'range disagrees with the position the device found'


def odd_one(ranges: Sequence[DeviceRange], place: Place, tolerance_m: float) -> int:
    """Return the index of the only range that is off by more than the tolerance, or -1.

    Parameters
    ----------
    ranges : sequence of DeviceRange
        Of one frame; those without the anchor's place are not judged.
    place : tuple of float
        Where the device found itself [m], in the frame of the anchors' places.
    tolerance_m : float
        By how much a range may be off the distance to that place; 0 judges nothing.
    """
    if not tolerance_m > 0.0:
        return -1
    places = [item.anchor_place for item in ranges]
    if len(ranges) < LEAST_RANGES or None in places or len(set(places)) < len(places):
        return -1
    off = [
        index
        for index, item in enumerate(ranges)
        if item.anchor_place is not None
        and abs(math.dist(item.anchor_place, place) - item.range_m) > tolerance_m
    ]
    return off[0] if len(off) == 1 else -1
