"""Pictures and lenses: sensor_msgs/Image and ImageSample, sensor_msgs/CameraInfo and Lens."""

from __future__ import annotations

from array import array

from sensor_msgs.msg import CameraInfo, Image

from tablerunner.messages.camera_info import MODEL, lens_from_message
from tablerunner.messages.image import image_from_message
from tablerunner.types import ImageSample, Lens
from tablerunner_ros.conversions.stamp import fill_stamp

__all__ = ['image_from_message', 'image_to_message', 'lens_from_message', 'lens_to_message']


def image_to_message(sample: ImageSample, frame: str) -> Image:
    """Return a picture as a message, in bgr8."""
    message = Image()
    fill_stamp(message.header.stamp, sample.stamp)
    message.header.frame_id = frame
    message.height, message.width = sample.pixels.shape[:2]
    message.encoding, message.step = 'bgr8', 3 * message.width
    # An array of bytes is taken as it is; every element of anything else would be checked.
    message.data = array('B', sample.pixels.tobytes())
    return message


def lens_to_message(lens: Lens, stamp: int, frame: str) -> CameraInfo:
    """Return a lens as a message."""
    message = CameraInfo()
    fill_stamp(message.header.stamp, stamp)
    message.header.frame_id = frame
    message.width, message.height = lens.width, lens.height
    message.distortion_model = MODEL
    message.d = list(lens.distortion)
    (fx, fy), (cx, cy) = lens.focal, lens.centre
    message.k = [fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0]
    message.r = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]
    message.p = [fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0]
    return message
