"""Take along what reports and pictures need of two large packages, from what is installed here.

    make lock    # runs this, too

plotly.js draws the figures of a report: 1.4 MB compressed, where the Python package around it takes 66 MB. The
characters of DejaVu Sans, which comes with matplotlib, are in the picture that the calibration node publishes.
"""

from __future__ import annotations

import gzip
from importlib.util import find_spec
from pathlib import Path

import numpy as np

DESIGN = Path(__file__).resolve().parents[1] / "src/sdimu_calibration/sdimu_calibration/report/design"
LEVEL = 5
"""Level of compression (1): 1 % larger than the highest level, in half the time."""
SIZES = (9, 10, 13)
"""Heights of the characters (px)."""
CHARACTERS = "".join(map(chr, [*range(32, 127), *range(160, 256), 0x2013, 0x2026, 0x2212, 0x3BC, 0x3C3]))
"""Latin 1, the dash, the ellipsis, the sign minus, mu and sigma."""


def folder_of(package: str) -> Path:
    """Where an installed package is."""
    spec = find_spec(package)
    if spec is None or spec.origin is None:
        raise SystemExit(f"{package} is not installed: make setup")
    return Path(spec.origin).parent


def library() -> bytes:
    """plotly.js as a report has it."""
    return gzip.compress((folder_of("plotly") / "package_data" / "plotly.min.js").read_bytes(), LEVEL, mtime=0)


def glyphs() -> dict[str, np.ndarray]:
    """Coverage (0 to 255) of each character at each size, one beside the other, and where each begins."""
    from PIL import Image, ImageDraw, ImageFont  # noqa: PLC0415 (comes with matplotlib)

    found = {"characters": np.array([ord(character) for character in CHARACTERS], np.uint32)}
    for size in SIZES:
        font = ImageFont.truetype(folder_of("matplotlib") / "mpl-data/fonts/ttf/DejaVuSans.ttf", size)
        ascent, descent = font.getmetrics()
        widths = [round(font.getlength(character)) for character in CHARACTERS]
        strip = Image.new("L", (sum(widths), ascent + descent))
        edges = np.concatenate([[0], np.cumsum(widths)])
        for character, left, width in zip(CHARACTERS, edges.tolist(), widths, strict=False):
            one = Image.new("L", (width, ascent + descent))
            ImageDraw.Draw(one).text((0, 0), character, fill=255, font=font)
            strip.paste(one, (left, 0))
        found |= {f"strip{size}": np.asarray(strip), f"edges{size}": edges.astype(np.int32)}
    return found


def main() -> None:
    """Write both files."""
    (DESIGN / "plotly.min.js.gz").write_bytes(library())
    np.savez_compressed(DESIGN / "glyphs.npz", **glyphs())


if __name__ == "__main__":
    main()
