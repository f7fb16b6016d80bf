"""Pictures and lenses to messages and back, and messages that are none."""

from __future__ import annotations

from array import array

import numpy as np
import pytest
from sensor_msgs.msg import CameraInfo, Image

from tablerunner.types import ImageSample, Lens, Refusal
from tablerunner_ros.conversions.image import (
    image_from_message,
    image_to_message,
    lens_from_message,
    lens_to_message,
)

STAMP = 1_234_567_890_123
PIXELS = np.random.default_rng(0).integers(0, 256, (6, 9, 3)).astype(np.uint8)
LENS = Lens(640, 480, (400.0, 401.0), (319.0, 241.0), (-0.2, 0.05, 0.001, -0.002, -0.005))


def test_picture_comes_back_from_its_message() -> None:
    message = image_to_message(ImageSample(STAMP, PIXELS), 'eye')
    assert (message.header.frame_id, message.encoding, message.step) == ('eye', 'bgr8', 27)
    back = image_from_message(message)
    assert back.stamp == STAMP
    assert np.array_equal(back.pixels, PIXELS)


@pytest.mark.parametrize('encoding', ['rgb8', 'bgra8', 'rgba8'])
def test_every_encoding_gives_the_same_picture(encoding: str) -> None:
    """With rows that are padded, as some cameras send them."""
    rows = PIXELS if encoding.startswith('bgr') else PIXELS[..., ::-1]
    if encoding.endswith('a8'):
        rows = np.concatenate([rows, np.full((6, 9, 1), 7, np.uint8)], axis=2)
    flat = np.concatenate([rows.reshape(6, -1), np.zeros((6, 5), np.uint8)], axis=1)
    message = Image(height=6, width=9, encoding=encoding, step=flat.shape[1])
    message.data = array('B', flat.tobytes())
    assert np.array_equal(image_from_message(message).pixels, PIXELS)


@pytest.mark.parametrize(
    ('changes', 'reason'),
    [
        ({'encoding': 'mono8'}, 'encoding'),
        ({'encoding': 'bayer_rggb8'}, 'encoding'),
        ({'encoding': ''}, 'encoding'),
        ({'height': 0}, 'picture without pixels'),
        ({'step': 26}, 'step is shorter than a row'),
        ({'height': 7}, 'data is not as long'),
        ({'encoding': 'bgra8'}, 'step is shorter than a row'),
    ],
)
def test_message_that_is_no_picture_is_refused(changes: dict, reason: str) -> None:
    message = image_to_message(ImageSample(STAMP, PIXELS), 'eye')
    for name, value in changes.items():
        setattr(message, name, value)
    refusal = image_from_message(message)
    assert isinstance(refusal, Refusal)
    assert refusal.reason.startswith(reason)


def test_lens_comes_back_from_its_message() -> None:
    message = lens_to_message(LENS, STAMP, 'eye')
    assert lens_from_message(message) == LENS
    message.d, message.distortion_model = [], ''
    assert lens_from_message(message).distortion == (0.0,) * 5


@pytest.mark.parametrize(
    ('changes', 'reason'),
    [
        ({'k': [0.0] * 9}, 'camera is not calibrated'),
        ({'k': [-1.0] * 9}, 'focal length'),
        ({'k': [float('nan')] * 9}, 'not finite'),
        ({'distortion_model': 'equidistant'}, 'distortion is not plumb_bob'),
        ({'d': [0.0] * 8}, 'distortion is not plumb_bob'),
        ({'width': 0}, 'camera without a size'),
        ({'binning_x': 2}, 'pictures are binned or cropped'),
    ],
)
def test_message_that_is_no_lens_is_refused(changes: dict, reason: str) -> None:
    message: CameraInfo = lens_to_message(LENS, STAMP, 'eye')
    for name, value in changes.items():
        setattr(message, name, value)
    refusal = lens_from_message(message)
    assert isinstance(refusal, Refusal)
    assert refusal.reason.startswith(reason)
