"""The simulated camera under the ceiling: it draws the room from above, pixel by pixel.

Its projection is its own: rays by cv2.projectPoints turned round, planes met by vectors. Nothing
of `tablerunner.vision` is used, so that a mistake there cannot hide behind the same one here.
"""

from tablerunner.simulation.camera.feed import CameraFeed
from tablerunner.simulation.camera.view import CeilingView, RobotView

__all__ = ['CameraFeed', 'CeilingView', 'RobotView']
