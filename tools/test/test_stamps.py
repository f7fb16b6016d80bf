"""Stamps change when, and only when, what they stand for does."""

from pathlib import Path

from bootstrap import stamps


def test_read_of_missing_or_damaged_stamp_is_empty(tmp_path: Path) -> None:
    damaged = tmp_path / 'damaged'
    damaged.write_bytes(b'\xff\xfe')
    assert stamps.read(tmp_path / 'none') == ''
    assert stamps.read(damaged) == ''


def test_write_then_read_returns_it(tmp_path: Path) -> None:
    path = tmp_path / 'deep' / 'stamp'
    stamps.write(path, 'abc')
    assert stamps.read(path) == 'abc'
    assert [p.name for p in path.parent.iterdir()] == ['stamp']


def test_digest_depends_on_words_names_and_contents(tmp_path: Path) -> None:
    first, second = tmp_path / 'a', tmp_path / 'b'
    first.write_text('x')
    second.write_text('x')
    digests = {
        stamps.digest(['w'], [first], tmp_path),
        stamps.digest(['v'], [first], tmp_path),
        stamps.digest(['w'], [second], tmp_path),
        stamps.digest(['w'], [first, second], tmp_path),
    }
    first.write_text('y')
    digests.add(stamps.digest(['w'], [first], tmp_path))
    assert len(digests) == 5


def test_digest_does_not_depend_on_order_of_files(tmp_path: Path) -> None:
    first, second = tmp_path / 'a', tmp_path / 'b'
    first.touch()
    second.touch()
    assert stamps.digest([], [first, second]) == stamps.digest([], [second, first])
