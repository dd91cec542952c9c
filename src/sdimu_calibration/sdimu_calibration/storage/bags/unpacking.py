"""Compressed data unpacked within bounds: a file of some kilobytes must not fill the memory."""

from __future__ import annotations

from io import BytesIO
from pathlib import Path

import zstandard
from lz4.frame import LZ4FrameDecompressor

BASE_BYTES = 128 << 20
"""Bytes that any file may unpack to: enough for a short one that is all zeros."""
RATIO = 64
"""Bytes out of one byte of a file: a recording of a sensor at rest, without noise, comes to 40."""
_PIECE = 1 << 20


class UnpackError(ValueError):
    """Compressed data that are damaged, or unpack to more than they may."""


def allowed(path: Path) -> int:
    """Bytes that a file, or the files of a folder, may unpack to."""
    files = [file for file in path.iterdir() if file.is_file()] if path.is_dir() else [path]
    return BASE_BYTES + RATIO * sum(file.stat().st_size for file in files)


class Allowance:
    """What may still come out of a file, block by block.

    Parameters
    ----------
    most : int
        Bytes.
    """

    def __init__(self, most: int) -> None:
        self._most = self._left = most

    def unpack(self, compression: str, data: bytes, size: int | None = None) -> bytes:
        """Unpack a block as `unpacked` does; `size` (bytes) is what it says itself.

        Raises
        ------
        UnpackError
            As there, and when all blocks together come to more than is allowed.
        """
        if size is not None and size > self._left:
            raise UnpackError(f"the file unpacks to more than {self._most} bytes")
        out = unpacked(compression, data, self._left if size is None else size)
        self._left -= len(out)
        return out


def unpacked(compression: str, data: bytes, most: int) -> bytes:
    """Unpack data.

    Parameters
    ----------
    compression : str
        ``zstd``, ``lz4`` (frames), or nothing.
    most : int
        Bytes that may come out.

    Raises
    ------
    UnpackError
        When they are damaged, unpack to more than `most` bytes, or the compression is unknown.
    """
    if compression == "zstd":
        return _zstd(data, most)
    if compression == "lz4":
        return _lz4(data, most)
    if compression:
        raise UnpackError(f"compressed by '{compression}', which cannot be read")
    return _within(data, most)


def _zstd(data: bytes, most: int) -> bytes:
    try:
        # The size that the data state is believed by the library: it would be allocated before anything is read.
        size = zstandard.frame_content_size(data)
        if size > most:
            raise UnpackError(f"unpacks to more than {most} bytes")
        if size >= 0:
            return bytes(zstandard.ZstdDecompressor().decompress(data))
        # One buffer that grows: pieces to be joined would be there twice.
        out = BytesIO()
        with zstandard.ZstdDecompressor().stream_reader(data) as stream:
            while out.tell() <= most and (piece := stream.read(_PIECE)):
                out.write(piece)
    except zstandard.ZstdError as error:
        raise UnpackError(str(error)) from error
    return _within(out.getvalue(), most)


def _lz4(data: bytes, most: int) -> bytes:
    frame, out, piece = LZ4FrameDecompressor(), BytesIO(), data
    try:
        while not frame.eof and out.tell() <= most:
            piece = frame.decompress(piece, max_length=_PIECE)
            if not piece and frame.needs_input:
                raise UnpackError("lz4 data are cut short")
            out.write(piece)
            piece = b""
    except RuntimeError as error:
        raise UnpackError(str(error)) from error
    return _within(out.getvalue(), most)


def _within(data: bytes, most: int) -> bytes:
    if len(data) > most:
        raise UnpackError(f"unpacks to more than {most} bytes")
    return data


def unpack_file(path: Path, target: Path) -> None:
    """Unpack a file of zstd into another one.

    Raises
    ------
    UnpackError
        When it is damaged, or unpacks to more than it may.
    """
    left = allowed(path)
    try:
        with path.open("rb") as packed, target.open("wb") as plain:
            stream = zstandard.ZstdDecompressor().stream_reader(packed)
            while piece := stream.read(_PIECE):
                left -= len(piece)
                if left < 0:
                    raise UnpackError(f"unpacks to more than {allowed(path)} bytes")
                plain.write(piece)
    except zstandard.ZstdError as error:
        raise UnpackError(str(error)) from error
