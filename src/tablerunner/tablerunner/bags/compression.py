"""Decompression of chunks, messages and files, as far as the data goes."""

from __future__ import annotations

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
        raw, problem = _stream(_lz4(), data)
    elif kind == 'zstd':
        raw, problem = _stream(_zstd().ZstdDecompressor(), data)
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
    return _stream(_zstd().ZstdDecompressor(), data)


def _stream(decompressor: Any, data: bytes) -> tuple[bytes, str]:
    """Feed data in small steps, so that what stands before a damaged place is kept."""
    step = 1 << 12
    parts = []
    problem = ''
    try:
        for start in range(0, len(data), step):
            if decompressor.eof:
                break
            parts.append(decompressor.decompress(data[start : start + step]))
    except Exception as error:  # each library has an error of its own, unrelated to others
        problem = f'the compressed data is damaged ({error})'
    return b''.join(parts), problem


def _lz4() -> Any:
    from lz4.frame import LZ4FrameDecompressor

    return LZ4FrameDecompressor()


def _zstd() -> Any:
    """Return the module of zstd; rosbags brings the one that fits the version of Python."""
    if sys.version_info >= (3, 14):
        from compression import zstd
    else:
        from backports import zstd
    return zstd
