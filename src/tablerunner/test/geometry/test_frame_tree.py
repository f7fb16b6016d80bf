"""Trees of frames: chains, roots, rotations, and what does not connect."""

import math

import numpy as np
import pytest

from tablerunner.geometry.frame_tree import FrameTree, Link
from tablerunner.geometry.rotation import (
    is_rotation,
    quaternion_of_rotation,
    quaternion_of_rpy,
    rotation_of_quaternion,
    rotation_of_rpy,
)


def tree(*links):
    made = FrameTree()
    for parent, child, *rpy in links:
        made.add(Link(parent, child, rotation_of_rpy(*(rpy or (0.0, 0.0, 0.0)))))
    return made


def test_chain_leads_down_from_ancestor_to_frame():
    """Links in order; nothing for the frame itself; none upwards or to strangers."""
    made = tree(('map', 'odom'), ('odom', 'base'), ('base', 'imu'), ('other', 'camera'))
    assert [link.child for link in made.chain('map', 'imu')] == ['odom', 'base', 'imu']
    assert made.chain('imu', 'imu') == ()
    assert made.chain('imu', 'map') is None
    assert made.chain('map', 'camera') is None
    assert (made.root('imu'), made.root('camera'), made.root('nobody')) == (
        'map',
        'other',
        'nobody',
    )


def test_ring_is_no_chain_and_ends():
    """Two frames that are each other's parent."""
    made = tree(('a', 'b'), ('b', 'a'))
    assert made.chain('map', 'a') is None
    assert made.root('a') in {'a', 'b'}


def test_rotation_is_the_product_along_the_chain():
    """A quarter turn left, then rolled over: the last link's x points left in the base."""
    made = tree(('base', 'mast', 0.0, 0.0, 0.5 * math.pi), ('mast', 'imu', math.pi, 0.0, 0.0))
    np.testing.assert_allclose(
        made.rotation('base', 'imu') @ (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), atol=1e-12
    )
    np.testing.assert_allclose(
        made.rotation('base', 'imu') @ (0.0, 0.0, 1.0), (0.0, 0.0, -1.0), atol=1e-12
    )


@pytest.mark.parametrize('seed', range(20))
def test_rotation_of_rpy_is_that_of_its_quaternion(seed):
    """Two ways to the same matrix, and it is a rotation."""
    rpy = np.random.default_rng(seed).uniform(-math.pi, math.pi, 3)
    matrix = rotation_of_rpy(*rpy)
    np.testing.assert_allclose(matrix, rotation_of_quaternion(quaternion_of_rpy(*rpy)), atol=1e-12)
    back = rotation_of_quaternion(quaternion_of_rotation(matrix))
    np.testing.assert_allclose(back, matrix, atol=1e-12)
    assert is_rotation(matrix)
    assert not is_rotation(-matrix)
    assert not is_rotation(1.1 * matrix)


@pytest.mark.parametrize('axis', range(3))
def test_rotation_by_half_a_turn_has_a_quaternion(axis):
    """Where w is zero."""
    rpy = [0.0, 0.0, 0.0]
    rpy[axis] = math.pi
    expected = [0.0] * 4
    expected[axis] = 1.0
    np.testing.assert_allclose(
        np.abs(quaternion_of_rotation(rotation_of_rpy(*rpy))), expected, atol=1e-12
    )


def test_rotation_of_rpy_is_that_of_urdf():
    """Fixed axes, roll first: R = Rz Ry Rx."""
    np.testing.assert_allclose(
        rotation_of_rpy(0.5 * math.pi, 0.0, 0.5 * math.pi) @ (0.0, 1.0, 0.0),
        (0.0, 0.0, 1.0),
        atol=1e-12,
    )
