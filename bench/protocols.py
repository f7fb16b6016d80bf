"""Parsing of device bytes: megabytes per second, and share of one core at a line's full rate."""

from __future__ import annotations

import json
import math
import struct
import time
from collections.abc import Callable, Iterator

from result import Result

from tablerunner.uwb.protocol import (
    Dwm1001Shell,
    Dwm1001Tlv,
    LinkTrack,
    Parser,
    Replay,
    Udp,
    capture_chunk,
    capture_header,
    open_protocol,
)

ROUNDS = 5
FRAMES = 2000
NODES = 8
PIECE = 100
"""Bytes of one read of a serial port: what comes within a millisecond at 921600 baud."""

SLOW_LINE = 115_200 / 10  # the DWM1001's [bytes/s]
FAST_LINE = 921_600 / 10  # the LinkTrack's
DATAGRAMS = 1000  # a second
MOST_SHARE = 0.1
"""Of one core, for a line that is never silent."""


def node_frame(mark: int, count: int, time_ms: int = 0) -> bytes:
    """Return a LinkTrack frame of some nodes."""
    system_time = time_ms.to_bytes(4, 'little')
    head = bytes(2) + system_time + bytes(109) if mark == 4 else bytes(6) + system_time + bytes(7)
    nodes = b''.join(
        bytes([1, k])
        + (3000 + 700 * k).to_bytes(3, 'little')
        + bytes([160, 156])
        + (bytes(6) if mark == 4 else b'')
        for k in range(count)
    )
    body = bytes([2, 1]) + head[2:-1] + bytes([count]) + nodes
    frame = bytes([0x55, mark]) + (len(body) + 5).to_bytes(2, 'little') + body
    return frame + bytes([sum(frame) % 256])


def places() -> list[tuple[int, tuple[float, float, float], float]]:
    """Return address, place and range of four anchors around a tag at (2, 3, 1)."""
    corners = [(0.0, 0.0, 2.2), (9.0, 0.0, 2.2), (9.0, 9.0, 2.2), (0.0, 9.0, 2.2)]
    return [(0x1000 + k, p, math.dist(p, (2.0, 3.0, 1.0))) for k, p in enumerate(corners)]


def lec_line() -> bytes:
    """Return a line of `lec`."""
    groups = ','.join(
        f'AN{k},{a:04X},{p[0]:.2f},{p[1]:.2f},{p[2]:.2f},{r:.2f}'
        for k, (a, p, r) in enumerate(places())
    )
    return f'DIST,4,{groups},POS,2.00,3.00,1.00,85\r\n'.encode()


def les_line() -> bytes:
    """Return a line of `les`."""
    words = ' '.join(f'{a:04X}[{p[0]:.2f},{p[1]:.2f},{p[2]:.2f}]={r:.2f}' for a, p, r in places())
    return f'{words} le_us=2500 est[2.00,3.00,1.00,85]\r\n'.encode()


def location_answer() -> bytes:
    """Return an answer to dwm_loc_get."""
    entries = b''.join(
        struct.pack('<HIBiiiB', a, round(1000 * r), 100, *(round(1000 * x) for x in p), 100)
        for a, p, r in places()
    )
    position = struct.pack('<BBiiiB', 0x41, 13, 2000, 3000, 1000, 85)
    return b'\x40\x01\x00' + position + bytes([0x49, 1 + len(entries), 4]) + entries


def datagrams() -> list[bytes]:
    """Return datagrams of eight ranges, numbered."""
    ranges = [
        {'anchor': f'A{k}', 'range': 3.0 + 0.7 * k, 'rx': -78.0, 'fp': -80.0} for k in range(NODES)
    ]
    return [
        json.dumps({'v': 1, 'tag': 'T', 'seq': n, 'time_us': 1000 * n, 'ranges': ranges}).encode()
        for n in range(FRAMES)
    ]


def reads(stream: bytes) -> list[bytes]:
    """Return a stream as a serial port hands it out."""
    return [stream[at : at + PIECE] for at in range(0, len(stream), PIECE)]


def rate(make: Callable[[], Parser], parts: list[bytes], ranges: int) -> float:
    """Return bytes a second of processor time, the best of some rounds.

    Raises
    ------
    RuntimeError
        Fewer ranges came out than went in.
    """
    best = math.inf
    for _ in range(ROUNDS):
        parser = make()
        found = 0
        begun = time.process_time()
        for stamp, part in enumerate(parts):
            found += len(parser.feed(part, stamp).ranges)
        best = min(best, time.process_time() - begun)
        if found != ranges:
            raise RuntimeError(f'{parser.source}: {found} ranges of {ranges}')
    return sum(map(len, parts)) / best


def measure() -> Iterator[Result]:
    """Measure all."""
    serial: list[tuple[str, Callable[[], Parser], bytes, int, int, float]] = [
        ('linktrack NodeFrame2', LinkTrack, node_frame(4, NODES), NODES, 0, FAST_LINE),
        ('linktrack NodeFrame3', LinkTrack, node_frame(5, NODES), NODES, 0, FAST_LINE),
        ('dwm1001 lec', Dwm1001Shell, lec_line(), 4, 0, SLOW_LINE),
        ('dwm1001 les', Dwm1001Shell, les_line(), 4, 1, SLOW_LINE),
        ('dwm1001 TLV', Dwm1001Tlv, location_answer(), 4, 0, SLOW_LINE),
    ]
    for name, make, frame, count, refused, line in serial:
        ours = rate(make, reads(frame * FRAMES), (FRAMES - refused) * count)
        what = f'reads of {PIECE} bytes, frames of {count} ranges'
        yield result(name, ours, line, f'{what}; reference: the line, never silent')
    frames = datagrams()
    ours = rate(Udp, frames, FRAMES * NODES)
    sent = sum(map(len, frames)) / FRAMES * DATAGRAMS
    yield result('udp', ours, sent, f'reference: {DATAGRAMS} datagrams of {NODES} ranges a second')
    file = capture_header('linktrack', 1) + b''.join(
        capture_chunk(k, part) for k, part in enumerate(reads(node_frame(5, NODES) * FRAMES))
    )
    blocks = [file[at : at + 65_536] for at in range(0, len(file), 65_536)]
    ours = rate(lambda: Replay(open_protocol), blocks, FRAMES * NODES)
    yield result('replay', ours, FAST_LINE, 'NodeFrame3 captured; reference: the line it was on')


def result(name: str, ours: float, reference: float, what: str) -> Result:
    """Return a figure with the share of a core, from bytes a second."""
    return Result(
        f'{name} parsing',
        ours / 1e6,
        reference / 1e6,
        reference / ours,
        'MB/s',
        f'{what}; ratio: share of one core',
        bound=MOST_SHARE,
    )
