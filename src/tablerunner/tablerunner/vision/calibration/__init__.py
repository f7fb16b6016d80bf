"""What a camera is like and where it hangs, from pictures: see docs/camera.md."""

from tablerunner.vision.calibration.boards import Board, LensFit, find_board, fit_lens
from tablerunner.vision.calibration.colours import ColourFit, fit_colour
from tablerunner.vision.calibration.mount_fit import MountFit, fit_mount

__all__ = [
    'Board',
    'ColourFit',
    'LensFit',
    'MountFit',
    'find_board',
    'fit_colour',
    'fit_lens',
    'fit_mount',
]
