"""Pictures in which nothing can be seen, told by a glance."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tablerunner.types import Lens

BLACK, WHITE = 16, 240
"""Grey levels below or above which all but a hundredth of a picture tells nothing."""

TORN_SHARE = 0.03
"""Rows at the lower end without any picture, as a share of all, from which it counts as torn."""

_STEP = 8


def picture_fault(pixels: NDArray[np.uint8], lens: Lens) -> str:
    """Return why a picture cannot be used; '' if it can.

    Parameters
    ----------
    pixels : ndarray of uint8, shape (height, width, 3)
    lens : Lens
        What the camera says of itself.
    """
    if pixels.shape != (lens.height, lens.width, 3):
        return 'picture is not of the size that camera_info says'
    some = pixels[::_STEP, ::_STEP].max(axis=2)
    if np.percentile(some, 99.0) < BLACK:
        return 'picture is black'
    if np.percentile(pixels[::_STEP, ::_STEP].min(axis=2), 1.0) > WHITE:
        return 'picture is white'
    # A transfer that broke off leaves rows of one colour; a sensor's noise is on every other.
    last = pixels[-max(round(TORN_SHARE * lens.height), 2) :, ::_STEP]
    if np.all(last == last[:, :1]):
        return 'picture is torn'
    return ''
