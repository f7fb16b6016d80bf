"""sensor_frames over DDS: latched transforms from parameters."""

from __future__ import annotations

import math
import re
from typing import Any

import numpy as np
import pytest
from rclpy.parameter import Parameter
from tf2_msgs.msg import TFMessage

from odom_node.frames_node import FramesNode
from tablerunner.errors import ConfigError
from tablerunner.geometry.frame_tree import FrameTree, Link
from tablerunner.messages.transforms import links_from_message
from tablerunner_ros.testing.probe import Probe

POSES = [0.1, 0.2, 0.3, math.pi, 0.0, 0.5, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]


def host(probe: Probe, **parameters: Any) -> None:
    """Run the node in this process."""
    overrides = [Parameter(name, value=value) for name, value in parameters.items()]
    probe.host(FramesNode, parameter_overrides=overrides)


def test_frames_of_parameters_are_latched(probe: Probe) -> None:
    """Whoever comes later gets them too; angles are those of URDF."""
    host(probe, frames=['imu_link', 'uwb_tag'], poses=POSES, parents=['base_link', 'imu_link'])
    probe.spin(0.2)
    heard = probe.listen(TFMessage, 'tf_static')
    probe.wait_for(lambda: heard, 'the transforms')
    tree = FrameTree()
    for link in links_from_message(heard[-1]):
        assert isinstance(link, Link)
        tree.add(link)
    chain = tree.chain('base_link', 'uwb_tag')
    assert chain is not None
    assert [link.translation for link in chain] == [(0.1, 0.2, 0.3), (0.0, 0.0, 1.0)]
    # Upside down and then turned to the left: its y axis points to the right and back.
    np.testing.assert_allclose(
        chain[0].rotation @ (0.0, 1.0, 0.0), (math.sin(0.5), -math.cos(0.5), 0.0), atol=1e-12
    )


@pytest.mark.parametrize(
    ('parameters', 'words'),
    [
        ({'frames': ['imu_link'], 'poses': [0.0]}, 'poses: got [0.0], expected 6 numbers'),
        ({'frames': ['a', 'a'], 'poses': [0.0] * 12}, "frames: got ['a', 'a'], expected each"),
        ({'frames': ['base_link'], 'poses': [0.0] * 6}, "frames: got ['base_link'], expected no"),
        (
            {'frames': ['a'], 'poses': [0.0] * 6, 'parents': ['a']},
            "parents: got ['a'], expected no frame as its own parent",
        ),
    ],
)
def test_frames_that_cannot_be_are_named(
    probe: Probe, parameters: dict[str, Any], words: str
) -> None:
    """As of every node."""
    with pytest.raises(ConfigError, match=re.escape(f'parameters of /sensor_frames: {words}')):
        host(probe, **parameters)
