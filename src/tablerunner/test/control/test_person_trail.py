"""The way a person walked: straight where it is straight, round the corner where it turns."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np

from tablerunner.control.person_trail import PersonTrail


def walked(*corners):
    """Return a trail along straight legs, a place every 5 cm, and its end."""
    trail = PersonTrail()
    for here, there in pairwise(corners):
        for share in np.linspace(0.0, 1.0, round(math.dist(here, there) / 0.05)):
            place = tuple(np.array(here) + share * (np.array(there) - np.array(here)))
            trail.add(place)
    return trail, corners[-1]


def test_trail_of_a_straight_walk_leads_to_the_person():
    trail, person = walked((0.0, 0.0), (4.0, 0.0))
    assert trail.aim((0.0, 0.1), person, 0.4) == person


def test_trail_round_a_corner_keeps_to_it():
    """From 1.6 m before a right angle the straight line to 2 m after it would cut 1.2 m off."""
    trail, person = walked((0.0, 0.0), (3.0, 0.0), (3.0, 2.0))
    x, y = trail.aim((1.4, 0.0), person, 0.4)
    # What is aimed at cuts the corner by at most what is allowed, and one crumb's spacing.
    assert x > 2.5
    assert y < 1.0
    offset = abs((3.0 - 1.4) * y - 0.0) / math.hypot(x - 1.4, y)
    assert offset <= 0.4 + 0.2


def test_trail_behind_the_robot_is_forgotten():
    trail, person = walked((0.0, 0.0), (3.0, 0.0), (3.0, 3.0))
    places = [(share, 0.0) for share in np.linspace(0.0, 3.0, 30)]
    places += [(3.0, share) for share in np.linspace(0.0, 2.0, 20)]
    for place in places:
        x, y = trail.aim(place, person, 0.3)
        # Always ahead along the way: never back to where it has been.
        assert x + y > place[0] + place[1] + 0.2
    assert trail.aim((3.0, 2.0), person, 0.3) == person


def test_trail_without_a_crumb_leads_to_the_person():
    assert PersonTrail().aim((0.0, 0.0), (2.0, 1.0), 0.4) == (2.0, 1.0)


def test_trail_reset_forgets():
    trail, _ = walked((0.0, 0.0), (3.0, 0.0), (3.0, 3.0))
    trail.reset()
    assert trail.end is None
    assert trail.aim((0.0, 0.0), (3.0, 3.0), 0.4) == (3.0, 3.0)
