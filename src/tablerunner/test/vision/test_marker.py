from __future__ import annotations

import pytest

from tablerunner.errors import ConfigError
from tablerunner.vision import MarkerConfig


@pytest.mark.parametrize(
    ('fields', 'words'),
    [
        ({'hues': ()}, r'hues: .*1 numbers'),
        ({'robots': ('a', 'b'), 'hues': (0.0, 90.0)}, 'heights'),
        ({'robots': ('a', 'a'), 'hues': (0.0, 90.0), 'heights': (1.0, 1.0)}, 'each name once'),
        ({'robots': ('a', 'b'), 'hues': (350.0, 10.0), 'heights': (1.0, 1.0)}, r'hues\[1\]'),
        ({'front_radius': 0.085}, 'front_radius'),
        ({'front_x': 0.05}, 'front_x'),
    ],
)
def test_markers_that_cannot_be_told_apart_are_refused(fields: dict, words: str) -> None:
    with pytest.raises(ConfigError, match=words):
        MarkerConfig(**fields)


def test_hues_are_compared_round_the_circle() -> None:
    MarkerConfig(('a', 'b'), (340.0, 20.0), (1.0, 1.0), hue_tolerance=18.0)
