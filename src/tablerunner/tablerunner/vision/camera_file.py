"""The lens in a file as ROS's camera drivers read it (camera_calibration's camera_info YAML)."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import yaml

from tablerunner.config import Config, load, parameter
from tablerunner.errors import ConfigError
from tablerunner.types import Lens

PLUMB_BOB = 'plumb_bob'


@dataclass(frozen=True)
class _Matrix(Config):
    rows: int = parameter(description='rows', low=1)
    cols: int = parameter(description='columns', low=1)
    data: tuple[float, ...] = parameter(description='row by row')

    def check(self) -> None:
        if len(self.data) != self.rows * self.cols:
            raise ConfigError('data', list(self.data), f'{self.rows} x {self.cols} numbers')


@dataclass(frozen=True)
class _CameraFile(Config):
    image_width: int = parameter(description='width of the pictures', unit='pixel', low=1)
    image_height: int = parameter(description='height of the pictures', unit='pixel', low=1)
    camera_matrix: _Matrix = parameter(description='K')
    distortion_coefficients: _Matrix = parameter(description='D')
    camera_name: str = parameter('camera', description='name')
    distortion_model: str = parameter(PLUMB_BOB, description='model', choices=(PLUMB_BOB,))
    rectification_matrix: _Matrix | None = parameter(None, description='R, not used')
    projection_matrix: _Matrix | None = parameter(None, description='P, not used')

    def check(self) -> None:
        if (self.camera_matrix.rows, self.camera_matrix.cols) != (3, 3):
            raise ConfigError('camera_matrix', self.camera_matrix.data, '3 x 3 numbers')
        if min(self.camera_matrix.data[0], self.camera_matrix.data[4]) <= 0.0:
            raise ConfigError(
                'camera_matrix.data', self.camera_matrix.data, 'focal lengths above 0: calibrate'
            )
        if len(self.distortion_coefficients.data) != 5:
            raise ConfigError(
                'distortion_coefficients.data',
                self.distortion_coefficients.data,
                '5 numbers: k1, k2, p1, p2, k3',
            )


def read_lens(path: Path) -> Lens:
    """Return the lens of a camera_info file.

    Raises
    ------
    ConfigError
        With file, line, field and value of what is wrong.
    """
    found = load(_CameraFile, path)
    k, d = found.camera_matrix.data, found.distortion_coefficients.data
    return Lens(
        found.image_width,
        found.image_height,
        (k[0], k[4]),
        (k[2], k[5]),
        (d[0], d[1], d[2], d[3], d[4]),
    )


def lens_text(lens: Lens, name: str) -> str:
    """Return the lines of a camera_info file."""
    (fx, fy), (cx, cy) = lens.focal, lens.centre

    def matrix(rows: int, values: list[float]) -> dict[str, object]:
        data = [round(value, 9) for value in values]
        return {'rows': rows, 'cols': len(values) // rows, 'data': data}

    content = {
        'image_width': lens.width,
        'image_height': lens.height,
        'camera_name': name,
        'camera_matrix': matrix(3, [fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0]),
        'distortion_model': PLUMB_BOB,
        'distortion_coefficients': matrix(1, list(lens.distortion)),
        'rectification_matrix': matrix(3, [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]),
        'projection_matrix': matrix(3, [fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0]),
    }
    return str(yaml.safe_dump(content, sort_keys=False, default_flow_style=None))
