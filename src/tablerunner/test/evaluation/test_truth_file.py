"""True positions from text: read to the nanosecond, or refused with the line."""

import numpy as np
import pytest

from tablerunner.errors import ConfigError
from tablerunner.evaluation.truth_file import read_truth


def test_stamps_of_today_keep_their_nanoseconds(tmp_path):
    file = tmp_path / 'path.csv'
    file.write_text('t,x,y\n1790000000.123456789,1,2\n\n1790000000.223456789, 1.5 ,2\n')
    truth = read_truth(file)
    assert truth.stamps.tolist() == [1790000000123456789, 1790000000223456789]
    assert truth.positions.tolist() == [[1.0, 2.0], [1.5, 2.0]]
    assert np.isnan(truth.headings).all()


def test_headings_are_unwrapped(tmp_path):
    file = tmp_path / 'path.csv'
    file.write_text('t,x,y,heading\n1,0,0,3.1\n2,0,0,-3.1\n')
    assert read_truth(file).headings == pytest.approx([3.1, 2 * np.pi - 3.1])


@pytest.mark.parametrize(
    ('lines', 'words'),
    [
        ('1,2,3\n2,x,3', ':3: got'),
        ('1,2,3\n2,nan,3', ':3: got'),
        ('nan,2,3\n2,2,3', ':2: got'),
        ('1e12,2,3\n2,2,3', ':2: got'),
        ('1,2\n2,3', ':2: got'),
        ('1,2,3,4,5', ':2: got'),
        ('2,0,0\n1,0,0', 'a later time'),
        ('1,0,0', 'two or more'),
        ('', 'two or more'),
    ],
)
def test_bad_line_is_named(tmp_path, lines, words):
    file = tmp_path / 'path.csv'
    file.write_text('t,x,y\n' + lines)
    with pytest.raises(ConfigError, match=words):
        read_truth(file)


def test_missing_file_is_named(tmp_path):
    with pytest.raises(ConfigError, match='a readable text file'):
        read_truth(tmp_path / 'none.csv')
