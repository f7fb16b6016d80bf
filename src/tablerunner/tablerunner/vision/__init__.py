"""Global vision: a camera under the ceiling that sees the robots' markers.

A pixel's ray meets the floor, the height of the marker corrects where (3-4), the camera's pose
takes it into the map (5); a marker of two discs shows the heading, one of a single disc leaves it
to the course (6); the observation (7) is a pose with its covariance. docs/camera.md has the
equations and the measured limits.
"""

from tablerunner.vision.ceiling_camera import (
    CameraMount,
    CeilingCamera,
    height_corrected,
    to_room,
)
from tablerunner.vision.course import CourseConfig, course, course_variance
from tablerunner.vision.finder import UNSEEN, MarkerFinder, Sighting
from tablerunner.vision.lens import distort, undistort
from tablerunner.vision.locator import CeilingLocator, LocatorConfig, Observation
from tablerunner.vision.marker import MarkerConfig
from tablerunner.vision.overlay import draw_overlay
from tablerunner.vision.picture import picture_fault

__all__ = [
    'UNSEEN',
    'CameraMount',
    'CeilingCamera',
    'CeilingLocator',
    'CourseConfig',
    'LocatorConfig',
    'MarkerConfig',
    'MarkerFinder',
    'Observation',
    'Sighting',
    'course',
    'course_variance',
    'distort',
    'draw_overlay',
    'height_corrected',
    'picture_fault',
    'to_room',
    'undistort',
]
