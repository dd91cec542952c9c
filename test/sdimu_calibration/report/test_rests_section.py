"""A run by hand shows its rests: in result.json to the last digit, and on the page."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sdimu_calibration.core.results import Calibration, Rest, no_history
from sdimu_calibration.report.page import Contents, page
from sdimu_calibration.storage.files.result_file import read_result, write_result

NONE = (float("nan"),) * 3
RESTS = (
    Rest(0.2, 51.7, (1e-4, 2e-4, -3e-5), (1e-3, -2e-3, 4e-3), NONE, 2e-4, 1e-3, float("nan")),
    Rest(
        60.0,
        64.5,
        (3e-4, 0.0, 0.0),
        (0.0, 0.0, 9.80665e-3),
        (2.9088820866572158e-4, 0.0, 0.0),
        2e-4,
        1e-3,
        1e-4,
        (0.0, 1e-3, 1.1e-2),
        (1.1e-3, 1.2e-3, 1.3e-3),
    ),
)
PLAIN = Calibration(
    "prior", ("gyro_bias",), ("gyro_bias_x",), ("rad/s",), ("deg/h",), np.zeros(1), np.eye(1), {}, {}, (), no_history(1)
)
BY_HAND = replace(PLAIN, rests=RESTS)


def test_rests_come_back_from_a_result_file(tmp_path):
    write_result(tmp_path / "result.json", BY_HAND)
    read = read_result(tmp_path).rests
    assert read[1] == RESTS[1]
    assert np.isnan(read[0].turn).all()
    unknown = {"turn": NONE, "turn_sigma": 0.0, "ahead": NONE, "ahead_sigma": NONE}
    assert replace(read[0], **unknown) == replace(RESTS[0], **unknown)
    write_result(tmp_path / "result.json", PLAIN)
    assert read_result(tmp_path).rests == ()
    assert '"rests"' not in (tmp_path / "result.json").read_text()


def test_the_page_lists_rests_with_residuals_in_units_and_sigmas():
    text = page(BY_HAND, Contents("by hand"))
    assert "Rests and their residuals" in text
    row = text.split("<td>60.0</td><td>64.5</td>")[1].split("</tr>")[0]
    # 1 mg of force on one axis is 9.8 mm/s^2: of 1 mm/s^2 sigma, RMS of three axes 5.66; one arcmin is 2.9 of 1e-4 rad.
    # Two digits of each sigma: 102 ug, 41 deg/h, .34 arcmin.
    assert row.replace("\N{EM SPACE}", " ") == (
        "<td>0 0 1000</td><td>5.66</td><td>62 0 0</td><td>0.87</td><td>1.00 0.00 0.00</td><td>1.68</td>"
    )
    assert "Rests and their residuals" not in page(PLAIN, Contents("on a table"))
