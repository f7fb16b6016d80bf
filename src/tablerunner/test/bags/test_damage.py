"""Damaged bags: what is left is read and right, what is missing is said, nothing raises."""

from __future__ import annotations

import shutil
import sqlite3
import struct
from binascii import crc32
from pathlib import Path

import lz4.frame
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from tablerunner.bags import messages
from tablerunner.bags.contract import CONTRACT
from tablerunner.bags.definitions import known_types
from tablerunner.bags.reader import BagReader
from tablerunner.bags.streams import bag_records
from tablerunner.bags.writer import STORAGES, BagWriter
from tablerunner.geometry.pose import Pose2
from tablerunner.types import OdometrySample, RangeSample

ODOM, CLOCK, RANGES = '/odom', '/clock', '/uwb/ranges'
COUNT = 1500
KINDS = ('mcap', 'mcap zstd', 'sqlite3')
quiet = settings(
    max_examples=30, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)


def content(number: int) -> tuple[str, bytes]:
    """Return topic and data of the message with this number."""
    types = known_types()
    if number % 3 == 0:
        message = messages.range_message(
            RangeSample(number + 1, f'A{number % 4}', 'tag', number, 1.0 + number), 'uwb_tag'
        )
        return RANGES, bytes(types.serialize_cdr(message, CONTRACT['uwb/ranges'].msgtype))
    message = messages.odometry_message(
        OdometrySample(number + 1, Pose2(number, 0.5 * number, 0.0), 0.1, 0.2), 'odom', 'base_link'
    )
    return ODOM, bytes(types.serialize_cdr(message, 'nav_msgs/msg/Odometry'))


class Originals(list[tuple[str, int, bytes]]):
    """The (topic, stamp, data) of all messages of the whole bags."""

    def __repr__(self) -> str:
        return f'<{len(self)} messages>'


@pytest.fixture(scope='module')
def originals() -> Originals:
    """Return all messages of the whole bags."""
    return Originals(
        (content(number)[0], number + 1, content(number)[1]) for number in range(COUNT)
    )


@pytest.fixture(scope='module')
def whole(tmp_path_factory: pytest.TempPathFactory, originals: Originals) -> dict[str, Path]:
    """Return one whole bag of several chunks or many pages for each kind of storage."""
    bags = {}
    for kind in KINDS:
        path = tmp_path_factory.mktemp('whole') / kind.replace(' ', '_')
        bags[kind] = path
        if kind == 'mcap zstd':
            writer = Writer(path, version=9, storage_plugin=StoragePlugin.MCAP)
            writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
            with writer:
                topics = {
                    topic: writer.add_connection(
                        topic, CONTRACT[topic[1:]].msgtype, typestore=known_types()
                    )
                    for topic in (ODOM, RANGES)
                }
                for topic, stamp, data in originals:
                    writer.write(topics[topic], stamp, data)
                    if stamp % 200 == 0:
                        writer.storage.close_chunk()
            continue
        with BagWriter(path, kind) as bag:
            for topic in (ODOM, RANGES):
                bag.add_topic(topic, CONTRACT[topic[1:]].msgtype)
            for topic, stamp, data in originals:
                bag.write_raw(topic, stamp, data)
                if stamp % 200 == 0:
                    bag.flush()  # many chunks
    return bags


def storage_file(bag: Path) -> Path:
    """Return the file that holds the messages."""
    return next(file for file in bag.iterdir() if file.suffix in ('.mcap', '.db3'))


def damaged_copy(bag: Path, folder: Path) -> Path:
    """Return a copy of a bag that a test may damage."""
    copy = folder / 'damaged'
    shutil.rmtree(copy, ignore_errors=True)
    shutil.copytree(bag, copy)
    return copy


def read(bag: Path) -> tuple[Originals, list[str]]:
    """Return all that can be read, and what is said to be missing."""
    with BagReader(bag) as reader:
        found = Originals((item.topic, item.stamp, item.data) for item in reader.raw())
        decoded = sum(1 for _ in reader.messages())
        lines = [str(item) for item in reader.damage]
    assert decoded == len(found)
    return found, lines


@pytest.mark.parametrize('kind', KINDS)
def test_bag_whole_reads_all_and_reports_nothing(
    kind: str, whole: dict[str, Path], originals: Originals
) -> None:
    assert read(whole[kind]) == (originals, [])


@pytest.mark.parametrize('kind', KINDS)
@quiet
@given(share=st.floats(0.0, 1.0, exclude_max=True))
def test_bag_cut_anywhere_gives_the_beginning_and_says_so(
    kind: str,
    share: float,
    whole: dict[str, Path],
    originals: Originals,
    tmp_path: Path,
) -> None:
    """Never an exception, never a message that was not written, and most of what is there."""
    bag = damaged_copy(whole[kind], tmp_path)
    file = storage_file(bag)
    size = file.stat().st_size
    kept = int(share * size)
    with file.open('r+b') as stream:
        stream.truncate(kept)
    found, lines = read(bag)
    assert lines
    everything = set(originals)
    assert all(item in everything for item in found)
    assert found == sorted(found, key=lambda item: item[1])
    if kind == 'mcap':
        assert found == originals[: len(found)]
        # The end holds indices only; a record may be cut in two.
        assert len(found) >= min(share * COUNT - 30, COUNT - 30)
    if kind == 'sqlite3' and share > 0.2:
        assert len(found) >= 0.5 * share * COUNT


@pytest.mark.parametrize('kind', KINDS)
@quiet
@given(share=st.floats(0.0, 1.0, exclude_max=True), seed=st.integers(0, 2**16))
def test_bag_hole_anywhere_never_raises(
    kind: str, share: float, seed: int, whole: dict[str, Path], tmp_path: Path
) -> None:
    """A piece of random bytes in the middle: no exception, and only what was announced."""
    bag = damaged_copy(whole[kind], tmp_path)
    file = storage_file(bag)
    data = bytearray(file.read_bytes())
    begin = int(share * len(data))
    noise = np.random.default_rng(seed).integers(0, 256, 300, dtype=np.uint8).tobytes()
    data[begin : begin + 300] = noise[: len(data) - begin]
    file.write_bytes(data)
    with BagReader(bag) as reader:
        count = sum(1 for _ in reader.messages())
        assert count <= COUNT
        assert list(reader.damage) or count == COUNT


def test_mcap_chunk_damaged_others_are_read(
    whole: dict[str, Path], originals: Originals, tmp_path: Path
) -> None:
    """With the head of its first chunk gone, a file still gives the later ones, by its summary."""
    bag = damaged_copy(whole['mcap'], tmp_path)
    file = storage_file(bag)
    data = bytearray(file.read_bytes())
    start = data.index(b'\x06', 20)
    data[start : start + 20] = bytes(20)
    file.write_bytes(data)
    found, lines = read(bag)
    assert 0 < len(found) < COUNT
    assert found == originals[-len(found) :]
    assert any('passed over' in line for line in lines)
    assert any('messages are named' in line for line in lines)


def test_sqlite_page_damaged_other_rows_are_read(
    whole: dict[str, Path], originals: Originals, tmp_path: Path
) -> None:
    """One page of rubbish costs its rows only, and the gap is told by row numbers."""
    bag = damaged_copy(whole['sqlite3'], tmp_path)
    file = storage_file(bag)
    data = bytearray(file.read_bytes())
    pages = len(data) // 4096
    leaves = [
        page
        for page in range(pages)
        if data[page * 4096] == 0x0D and data[page * 4096 : (page + 1) * 4096].count(b'odom')
    ]
    page = leaves[len(leaves) // 2]
    data[page * 4096 : (page + 1) * 4096] = b'\xff' * 4096
    file.write_bytes(data)
    found, lines = read(bag)
    assert COUNT - 20 <= len(found) < COUNT
    assert set(found) <= set(originals)
    assert any('messages' in line and 'to' in line and 'missing' in line for line in lines)


def test_sqlite_recorder_killed_gives_last_commit(tmp_path: Path) -> None:
    """A journal beside the file: read as of the last whole commit, and the bag is left alone."""
    bag = tmp_path / 'bag'
    with BagWriter(bag, 'sqlite3') as writer:
        writer.add_topic('clock', CONTRACT['clock'].msgtype)
        for stamp in range(1, 1001):
            writer.write('clock', stamp, messages.clock_message(stamp))
    file = storage_file(bag)
    connection = sqlite3.connect(file)
    connection.execute('PRAGMA cache_size = 2')
    connection.execute('PRAGMA cache_spill = 2')
    connection.execute('UPDATE messages SET timestamp = timestamp + 5000')
    killed = tmp_path / 'killed'
    shutil.copytree(bag, killed)
    connection.close()
    journal = killed / f'{file.name}-journal'
    assert journal.stat().st_size > 0
    before = (killed / file.name).read_bytes()
    found, lines = read(killed)
    assert [stamp for _, stamp, _ in found] == list(range(1, 1001))
    assert any('did not close it' in line for line in lines)
    assert (killed / file.name).read_bytes() == before


@pytest.mark.parametrize('storage', STORAGES)
def test_bag_without_metadata_is_read(
    storage: str, whole: dict[str, Path], originals: Originals, tmp_path: Path
) -> None:
    bag = damaged_copy(whole[storage], tmp_path)
    (bag / 'metadata.yaml').unlink()
    found, lines = read(bag)
    assert found == originals
    assert lines == ['metadata.yaml: it is missing; files and topics were found without it']


@pytest.mark.parametrize('text', ['', 'a: [', 'rosbag2_bagfile_information: 3', '\x00\xff'])
def test_bag_broken_metadata_is_read(
    text: str, whole: dict[str, Path], originals: Originals, tmp_path: Path
) -> None:
    bag = damaged_copy(whole['mcap'], tmp_path)
    (bag / 'metadata.yaml').write_bytes(text.encode('latin-1'))
    found, lines = read(bag)
    assert found == originals
    assert len(lines) == 1
    assert 'cannot be read' in lines[0]


def test_bag_file_missing_is_said(whole: dict[str, Path], tmp_path: Path) -> None:
    bag = damaged_copy(whole['mcap'], tmp_path)
    storage_file(bag).unlink()
    found, lines = read(bag)
    assert found == []
    assert any('the file is missing' in line for line in lines)
    assert any(f'{RANGES}: 500 messages are named, 0 were found' in line for line in lines)


def test_bag_undecodable_message_is_left_out_and_counted(tmp_path: Path) -> None:
    """A payload that is cut off or of another type costs itself only."""
    bag = tmp_path / 'bag'
    _, good = content(1)
    with BagWriter(bag) as writer:
        writer.add_topic('odom', 'nav_msgs/msg/Odometry')
        for stamp, data in enumerate((good, good[:60], b'', b'\x00\x01\x00\x00' + b'\xff' * 900)):
            writer.write_raw('odom', stamp + 1, data)
        writer.write_raw('odom', 9, good)
    with BagReader(bag) as reader:
        assert [item.stamp for item in reader.messages()] == [1, 9]
        assert [str(item) for item in reader.damage if 'cannot be decoded' in str(item)] == [
            str(reader.damage[0])
        ]
        assert '/odom: 3 messages cannot be decoded, the first at 2 ns' in str(reader.damage[0])


def test_bag_broken_definition_known_type_is_used(tmp_path: Path) -> None:
    """The text of a definition is damaged, but this program knows the type."""
    bag = tmp_path / 'bag'
    with BagWriter(bag) as writer:
        writer.add_topic('odom', 'nav_msgs/msg/Odometry')
        writer.write_raw('odom', 1, content(1)[1])
    file = storage_file(bag)
    data = file.read_bytes().replace(b'std_msgs/Header header', b'std_msgs/Header [[[[[[')
    file.write_bytes(data)
    with BagReader(bag) as reader:
        assert len(list(reader.messages())) == 1
        assert 'the definition known here is used' in str(reader.damage[0])


def test_bag_unknown_type_without_definition_is_left_out(tmp_path: Path) -> None:
    bag = tmp_path / 'bag'
    with BagWriter(bag, 'sqlite3') as writer:
        writer.add_topic('odom', 'nav_msgs/msg/Odometry')
        writer.write_raw('odom', 1, content(1)[1])
    connection = sqlite3.connect(storage_file(bag))
    connection.execute("UPDATE topics SET type = 'nowhere_msgs/msg/Lost'")
    connection.commit()
    connection.close()
    with BagReader(bag) as reader:
        assert list(reader.messages()) == []
        assert len(list(reader.raw())) == 1
        assert 'nowhere_msgs/msg/Lost: the bag holds no definition of it' in str(reader.damage[0])


def rechunk(file: Path, kind: str) -> None:
    """Write an MCAP file again with its chunks compressed and with checksums, without an end."""
    data = file.read_bytes()
    out, here = bytearray(data[:8]), 8
    while here < len(data) - 8:
        opcode, length = struct.unpack_from('<BQ', data, here)
        body = data[here + 9 : here + 9 + length]
        if opcode == 0x06:
            raw = body[40:]  # rosbags leaves them uncompressed here
            packed = lz4.frame.compress(raw) if kind == 'lz4' else raw
            name = kind.encode()
            body = (
                body[:24]
                + struct.pack('<II', crc32(raw), len(name))
                + name
                + struct.pack('<Q', len(packed))
                + packed
            )
        if opcode in (0x01, 0x06, 0x0F):
            out += struct.pack('<BQ', opcode, len(body)) + body
        here += 9 + length
    file.write_bytes(bytes(out))


@pytest.mark.parametrize('kind', ['', 'lz4'])
def test_mcap_chunk_that_contradicts_its_checksum_is_left_out(
    kind: str, whole: dict[str, Path], originals: Originals, tmp_path: Path
) -> None:
    """With checksums a changed byte is noticed: its chunk goes, the others stay."""
    bag = damaged_copy(whole['mcap'], tmp_path)
    file = storage_file(bag)
    rechunk(file, kind)
    found, lines = read(bag)
    assert found == originals
    assert len(lines) == 1
    assert 'the index at the end' in lines[0]
    data = bytearray(file.read_bytes())
    place = data.index(b'uwb_tag', len(data) // 2)
    data[place] ^= 0x01
    file.write_bytes(data)
    found, lines = read(bag)
    assert COUNT - 250 < len(found) < COUNT
    assert set(found) < set(originals)
    assert any('checksum' in line or 'compressed data' in line for line in lines)


@pytest.mark.parametrize('offset', [9 + 28, 9 + 32])
def test_mcap_chunk_whose_head_contradicts_itself_is_passed_over(
    offset: int, whole: dict[str, Path], originals: Originals, tmp_path: Path
) -> None:
    """A wrong length inside the head of the first chunk: the next chunk is found by its shape."""
    bag = damaged_copy(whole['mcap'], tmp_path)
    file = storage_file(bag)
    data = bytearray(file.read_bytes())
    data[data.index(b'\x06', 20) + offset] ^= 0x40
    file.write_bytes(data)
    found, lines = read(bag)
    assert len(found) > COUNT - 250
    assert found == originals[-len(found) :]
    assert any('the head of a chunk' in line for line in lines)


def test_mcap_topic_record_lost_says_so(whole: dict[str, Path], tmp_path: Path) -> None:
    """First chunk and end are gone, and with them what tells which topic a message is of."""
    bag = damaged_copy(whole['mcap'], tmp_path)
    file = storage_file(bag)
    data = bytearray(file.read_bytes())
    start = data.index(b'\x06', 20)
    data[start : start + 20] = bytes(20)
    file.write_bytes(data[: len(data) * 9 // 10])
    with BagReader(bag) as reader:
        assert reader.message_count == 0
        lines = [str(item) for item in reader.damage]
    assert any('record that names a topic is missing' in line for line in lines)
    assert any('messages of it cannot be read' in line for line in lines)


def test_sqlite_row_with_a_wrong_number_makes_none_come_twice(
    whole: dict[str, Path], originals: Originals, tmp_path: Path
) -> None:
    """A row in the middle claims to be number 128 and the page behind it is gone: reading must
    not begin again from 128.
    """
    bag = damaged_copy(whole['sqlite3'], tmp_path)
    file = storage_file(bag)
    data = bytearray(file.read_bytes())
    page = data.index(originals[COUNT // 2][2]) // 4096 * 4096
    cells = int.from_bytes(data[page + 3 : page + 5], 'big')
    pointer = page + 8 + 2 * (cells - 2)  # Python loses the last row before a fault anyway
    cell = page + int.from_bytes(data[pointer : pointer + 2], 'big')
    key = cell + (2 if data[cell] & 0x80 else 1)  # behind the length
    number = (data[key] & 0x7F) << 7 | data[key + 1]
    data[key : key + 2] = b'\x81\x00'
    following = data.index(originals[number + 1][2]) // 4096 * 4096
    assert following != page
    data[following : following + 4096] = b'\xff' * 4096
    file.write_bytes(data)
    found, lines = read(bag)
    assert len(found) == len(set(found))
    assert COUNT - 40 < len(found) < COUNT
    assert set(found) <= set(originals)
    assert lines


def test_bag_definition_of_another_version_is_the_one_used(tmp_path: Path) -> None:
    """An old bag says itself how its messages are laid out, whatever this program knows."""
    types = get_typestore(Stores.EMPTY)
    name = 'tablerunner_interfaces/msg/UwbRange'
    types.register(get_types_from_msg('string anchor_id\nfloat64 distance\n', name))
    with BagWriter(tmp_path / 'bag', types=types) as writer:
        writer.add_topic('uwb/ranges', name)
        writer.write('uwb/ranges', 1, types.types[name](anchor_id='A0', distance=2.5))
    with BagReader(tmp_path / 'bag') as reader:
        (item,) = reader.messages()
        assert item.message.distance == 2.5
        assert reader.damage == ()
        assert list(bag_records(reader, ['uwb/ranges'])) == []
        assert 'not as this program knows the type' in str(reader.damage[0])
