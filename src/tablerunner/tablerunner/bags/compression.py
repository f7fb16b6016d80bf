"""Decompression of chunks, messages and files, as far as the data goes."""

from __future__ import annotations

import math
import sys
from binascii import crc32
from typing import Any


def decompress(data: bytes, kind: str, size: int, checksum: int) -> tuple[bytes, str]:
    """Return the data of a chunk and what is wrong with it (empty: nothing).

    Parameters
    ----------
    data : bytes
        As stored; may be cut off.
    kind : str
        Compression as MCAP names it: empty, ``lz4`` or ``zstd``.
    size : int
        Size of the data when whole [byte].
    checksum : int
        CRC-32 of the data when whole; 0 for none. Data that contradicts it is not returned.
    """
    if kind == '':
        raw, problem = bytes(data), ''
    elif kind == 'lz4':
        raw, problem = _stream(_lz4(), data, RuntimeError, size)
    elif kind == 'zstd':
        zstd = _zstd()
        raw, problem = _stream(zstd.ZstdDecompressor(), data, zstd.ZstdError, size)
    else:
        return b'', f'a chunk is compressed by {kind!r}, which is not known'
    if len(raw) > size:
        return b'', f'a chunk of {size} bytes holds {len(raw)}'
    if checksum and (len(raw) != size or crc32(raw) != checksum):
        return b'', 'a chunk contradicts its checksum'
    return raw, problem


def decompress_message(data: bytes) -> bytes:
    """Return a message that was compressed alone by zstd; ValueError when it is damaged."""
    zstd = _zstd()
    try:
        return bytes(zstd.decompress(data))
    except zstd.ZstdError as error:
        raise ValueError(f'a message cannot be decompressed ({error})') from error


def decompress_file(data: bytes) -> tuple[bytes, str]:
    """Return a file that was compressed by zstd, and what is wrong with it (empty: nothing)."""
    zstd = _zstd()
    return _stream(zstd.ZstdDecompressor(), data, zstd.ZstdError)


def _stream(
    decompressor: Any, data: bytes, damaged: type[Exception], most: float = math.inf
) -> tuple[bytes, str]:
    """Feed data in small steps, so that what stands before a damaged place is kept.

    It ends once there is more than `most`: damaged data may claim to be of any size.
    """
    step = 1 << 12
    parts: list[bytes] = []
    total, problem = 0, ''
    try:
        for start in range(0, len(data), step):
            if decompressor.eof or total > most:
                break
            parts.append(decompressor.decompress(data[start : start + step]))
            total += len(parts[-1])
    except (damaged, ValueError, EOFError) as error:
        problem = f'the compressed data is damaged ({error})'
    return b''.join(parts), problem


def _lz4() -> Any:
    from lz4.frame import LZ4FrameDecompressor  # type: ignore[import-untyped]

    return LZ4FrameDecompressor()


def _zstd() -> Any:
    """Return the module of zstd; rosbags brings the one that fits the version of Python."""
    if sys.version_info >= (3, 14):
        from compression import zstd
    else:
        from backports import zstd
    return zstd
