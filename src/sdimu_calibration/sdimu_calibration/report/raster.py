"""A small picture drawn point by point, with words, as PNG: what a node publishes must not need a library of figures.

The characters are those of DejaVu Sans (free to use and to pass on), drawn once by requirements/vendored.py.
"""

from __future__ import annotations

import struct
import zlib
from dataclasses import dataclass
from functools import cache
from importlib.resources import files

import numpy as np
from numpy.typing import NDArray

Colour = tuple[int, int, int]
LEFT, CENTRE, RIGHT = 0.0, 0.5, 1.0
"""Which part of a text, or of its height, stands at the point that is named."""
_UNKNOWN = "?"
"""Character in the place of those that there are no points of."""
_LEVEL = 9
"""Level of compression of the points (1)."""


@dataclass(frozen=True)
class _Font:
    """Characters of one height."""

    strip: NDArray[np.float64]
    """Coverage (0 to 1), one character beside the other, shape (h, w)."""
    edges: NDArray[np.int32]
    """Column at which each begins, shape (n + 1,)."""
    place: dict[str, int]
    """Number of each character."""

    def coverage(self, words: str) -> NDArray[np.float64]:
        """Coverage (0 to 1) of a line of text, shape (h, width)."""
        numbers = [self.place.get(character, self.place[_UNKNOWN]) for character in words]
        parts = [self.strip[:, self.edges[k] : self.edges[k + 1]] for k in numbers]
        return np.hstack([self.strip[:, :0], *parts])


@cache
def _font(size: int) -> _Font:
    with (files("sdimu_calibration.report.design") / "glyphs.npz").open("rb") as stream, np.load(stream) as kept:
        place = {chr(code): k for k, code in enumerate(kept["characters"].tolist())}
        return _Font(kept[f"strip{size}"] / 255.0, kept[f"edges{size}"], place)


def colour(written: str) -> Colour:
    """Red, green and blue (0 to 255) of ``#rrggbb``."""
    red, green, blue = bytes.fromhex(written.removeprefix("#"))
    return red, green, blue


class Raster:
    """White points, `high` rows of `wide`; places are counted from the left and from the top (px)."""

    def __init__(self, wide: int, high: int) -> None:
        self.points = np.full((high, wide, 3), 255, np.uint8)

    def box(self, left: float, top: float, right: float, bottom: float, ink: Colour) -> None:
        """Fill a rectangle; one that is thinner than a point is one point thin."""
        x, y = round(left), round(top)
        self.points[max(y, 0) : max(round(bottom), y + 1), max(x, 0) : max(round(right), x + 1)] = ink

    def frame(self, left: float, top: float, right: float, bottom: float, ink: Colour) -> None:
        """Draw the edges of a rectangle, one point wide."""
        for y in (top, bottom):
            self.box(left, y, right + 1, y, ink)
        for x in (left, right):
            self.box(x, top, x, bottom + 1, ink)

    def dashed(self, x: float, top: float, bottom: float, ink: Colour, dash: int = 5, gap: int = 3) -> None:
        """Draw an upright dashed line."""
        for start in range(round(top), round(bottom), dash + gap):
            self.box(x, start, x + 1, min(start + dash, bottom), ink)

    def text(
        self, x: float, y: float, words: str, ink: Colour, size: int, across: float = LEFT, down: float = CENTRE
    ) -> None:
        """Write a line of text; what lies outside of the picture is cut off.

        Parameters
        ----------
        x, y : float
            The point that is named (px).
        ink : tuple of int
            Red, green and blue.
        size : int
            Height of the characters (px): one of those in requirements/vendored.py.
        across, down : float
            Share of the width, and of the height, that lies before the point.
        """
        covered = _font(size).coverage(words)
        left, top = round(x - across * covered.shape[1]), round(y - down * covered.shape[0])
        covered = covered[max(-top, 0) :, max(-left, 0) :]
        below = self.points[max(top, 0) :, max(left, 0) :][: covered.shape[0], : covered.shape[1]]
        share = covered[: below.shape[0], : below.shape[1], None]
        below[:] = np.rint((1.0 - share) * below + share * np.array(ink, np.float64)).astype(np.uint8)

    def png(self) -> bytes:
        """Return the picture as PNG: the same bytes for the same points."""
        high, wide, _ = self.points.shape
        # A colour as one number: rows of three are sorted thirty times slower.
        packed = self.points.astype(np.uint32) @ np.array([1 << 16, 1 << 8, 1], np.uint32)
        colours, numbers = np.unique(packed, return_inverse=True)
        few = len(colours) <= 256
        rows = numbers.reshape(high, wide).astype(np.uint8) if few else self.points.reshape(high, -1)
        # Each row begins with the number of its filter: none.
        lines = np.hstack([np.zeros((high, 1), np.uint8), rows]).tobytes()
        head = struct.pack(">IIBBBBB", wide, high, 8, 3 if few else 2, 0, 0, 0)
        parts = [(b"IHDR", head), (b"IDAT", zlib.compress(lines, _LEVEL)), (b"IEND", b"")]
        if few:
            parts.insert(1, (b"PLTE", colours.astype(">u4").view(np.uint8).reshape(-1, 4)[:, 1:].tobytes()))
        return b"\x89PNG\r\n\x1a\n" + b"".join(_chunk(kind, content) for kind, content in parts)


def _chunk(kind: bytes, content: bytes) -> bytes:
    return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))
