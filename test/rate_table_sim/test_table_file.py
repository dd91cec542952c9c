"""Table files: units, axes, one-line errors."""

import numpy as np
import pytest

from rate_table_sim.table_file import load_table
from sdimu_calibration.core.recording import DataError

TEXT = """
format: sdimu-table/1
axes: {outer: Z, middle: Y, inner: X}
sample_rate: 200 Hz
imperfections: {wobble: 2 arcsec, base_tilt_east: -1 arcmin}
"""


def test_units_become_si(tmp_path):
    path = tmp_path / "mine.yaml"
    path.write_text(TEXT)
    table = load_table(path)
    assert table.name == "mine"
    assert table.axes == ("Z", "Y", "X")
    assert table.imperfections.wobble_rad == pytest.approx(np.radians(2 / 3600))
    assert table.imperfections.base_tilt_east_rad == pytest.approx(-np.radians(1 / 60))


def test_the_tables_that_come_along_load():
    assert load_table("ideal").axes == ("Y", "Z", "X")
    assert load_table("free").axes is None


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("200 Hz", "200 s", "sample_rate: .*wrong unit.*Hz"),
        ("wobble", "wobbel", "imperfections.wobbel: unknown key.*wobble"),
        ("middle: Y", "middle: Z", "adjacent axes must differ"),
        ("inner: X", "inner: Q", "axes.*'X', 'Y' or 'Z'"),
    ],
)
def test_a_wrong_file_gives_one_line_with_file_and_key(tmp_path, old, new, message):
    path = tmp_path / "wrong.yaml"
    path.write_text(TEXT.replace(old, new))
    with pytest.raises(DataError, match=message) as caught:
        load_table(path)
    assert "\n" not in str(caught.value)
    assert "wrong.yaml" in str(caught.value)
