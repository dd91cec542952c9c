"""The picture of a live diagnosis says its numbers by place, colour and length, and needs no library of figures."""

from __future__ import annotations

import subprocess
import sys
from io import BytesIO

import numpy as np
import pytest
from PIL import Image

from sdimu_calibration.core.diagnosis.live_diagnosis import LiveDiagnosis, ModelError, Ranked
from sdimu_calibration.core.evidence.consistency import CHANNEL_NAMES, StopMean
from sdimu_calibration.report import live_picture as module
from sdimu_calibration.report.live_picture import live_picture
from sdimu_calibration.report.raster import CENTRE, RIGHT, Raster, colour

INK = (0, 0, 0)


def diagnosis(threshold: float = 4.0, held_out: float = 1.7) -> LiveDiagnosis:
    where = tuple(
        StopMean(name, stop, 9.0 if (row, stop) == (2, 3) else -9.0 if (row, stop) == (4, 1) else 0.0)
        for row, name in enumerate(CHANNEL_NAMES)
        for stop in range(5)
    )
    ranking = tuple(Ranked(f"effect_{z}", float(z), 1e-6 * z, 1e-6, "ppm") for z in (12, 6, 3))
    return LiveDiagnosis(
        4,
        600.0,
        "misfit",
        "",
        threshold=threshold,
        where=where,
        ranking=ranking,
        ladder=(ModelError((), 2.0, held_out),),
    )


def points(png: bytes) -> np.ndarray:
    with Image.open(BytesIO(png)) as picture:
        return np.asarray(picture.convert("RGB")).astype(int)


def test_the_file_has_every_point_of_few_colours_and_of_many():
    rng = np.random.default_rng(3)
    for most in (4, 256):
        drawn = Raster(31, 23)
        drawn.points[:] = rng.integers(0, most, drawn.points.shape)
        np.testing.assert_array_equal(points(drawn.png()), drawn.points)
        assert drawn.png() == drawn.png()


def test_words_stand_where_they_are_asked_for_and_are_cut_at_the_edge():
    for across, columns in ((0.0, slice(100, 200)), (CENTRE, slice(60, 140)), (RIGHT, slice(0, 100))):
        drawn = Raster(200, 40)
        drawn.text(100, 20, "words", INK, 13, across)
        dark = np.flatnonzero((drawn.points < 128).any(axis=(0, 2)))
        assert len(dark)
        assert dark.min() >= columns.start
        assert dark.max() < columns.stop
    drawn = Raster(20, 10)
    drawn.text(-5, -2, "far longer than the picture is wide \N{SNOWMAN}", INK, 13)
    drawn.text(18, 9, "beyond", INK, 13)


def test_cells_have_the_colour_of_their_sign():
    drawn = points(live_picture(diagnosis()))
    width = (module._RIGHT - module._LEFT) / 5

    def corner(row: int, column: int) -> np.ndarray:
        return drawn[module._TOP + module._ROW * row + 2, round(module._LEFT + width * column) + 2]

    positive, negative, nothing = corner(2, 3), corner(4, 1), corner(0, 0)
    assert positive[0] > positive[2] + 50
    assert negative[2] > negative[0] + 50
    assert (nothing == 255).all()


def test_bars_are_as_long_as_their_scores():
    drawn = points(live_picture(diagnosis()))
    bar = np.array(colour("#d5d9df"))
    first = module._TOP + module._ROW * len(CHANNEL_NAMES) + module._BELOW + module._GAP
    lengths = []
    for row in range(3):
        line = drawn[first + module._BAR * row + module._BAR // 2 - 5]
        lengths.append(np.flatnonzero((line == bar).all(axis=1)).max() - module._LEFT)
    np.testing.assert_allclose(lengths, lengths[0] * np.array([12, 6, 3]) / 12.0, atol=2.0)


@pytest.mark.parametrize(
    "found",
    [diagnosis(threshold=float("inf")), diagnosis(held_out=float("nan")), LiveDiagnosis(0, 10.0, "consistent", "")],
)
def test_what_is_not_known_yet_leaves_a_picture(found):
    assert points(live_picture(found)).shape[1] == module._WIDTH


def test_a_picture_is_small_and_needs_no_library_of_figures():
    assert len(live_picture(diagnosis())) < 40_000
    code = (
        "import sys\n"
        "from sdimu_calibration.report.live_picture import live_picture\n"
        "sys.exit(', '.join({'matplotlib', 'PIL', 'plotly'} & set(sys.modules)) or 0)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
