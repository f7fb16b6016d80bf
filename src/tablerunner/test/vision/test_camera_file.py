from __future__ import annotations

from pathlib import Path

import pytest

from tablerunner.errors import ConfigError
from tablerunner.types import Lens
from tablerunner.vision.camera_file import lens_text, read_lens

LENS = Lens(640, 480, (400.5, 401.25), (319.0, 241.5), (-0.2, 0.05, 0.001, -0.002, -0.005))


def test_lens_comes_back_from_its_file(tmp_path: Path) -> None:
    path = tmp_path / 'camera_info.yaml'
    path.write_text(lens_text(LENS, 'ceiling'))
    assert read_lens(path) == LENS


@pytest.mark.parametrize(
    ('good', 'bad', 'words'),
    [
        ('plumb_bob', 'equidistant', 'distortion_model: .*plumb_bob'),
        ('cols: 5', 'cols: 4', r'distortion_coefficients.data: .*1 x 4 numbers'),
        ('400.5', '0.0', 'focal lengths above 0'),
        ('400.5', 'wide', r'camera_matrix.data\[0\]'),
        ('image_width: 640\n', '', 'image_width'),
        ('image_width', '[', 'YAML'),
    ],
)
def test_file_that_is_no_lens_is_refused(tmp_path: Path, good: str, bad: str, words: str) -> None:
    path = tmp_path / 'camera_info.yaml'
    text = lens_text(LENS, 'ceiling')
    assert good in text
    path.write_text(text.replace(good, bad, 1))
    with pytest.raises(ConfigError, match=words):
        read_lens(path)
