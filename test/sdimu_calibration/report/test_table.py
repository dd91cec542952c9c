"""People read customary units, and the page says the same as the numbers."""

from __future__ import annotations

import re
from dataclasses import replace
from io import StringIO

import numpy as np
import pytest
from rich.console import Console

from sdimu_calibration.core.plain_text import three
from sdimu_calibration.core.results import Calibration, History
from sdimu_calibration.core.units import to_si
from sdimu_calibration.report.coefficients import grouped_table
from sdimu_calibration.report.figures import rotations, sigma_history, spread
from sdimu_calibration.report.groups import groups, short_name
from sdimu_calibration.report.page import Contents, page
from sdimu_calibration.report.table import cells, headings, rich_table, rows, with_sigma


@pytest.fixture
def calibration() -> Calibration:
    names = ("gyro_bias_x", "gyro_bias_y", "accel_misalignment_xy", "accel_misalignment_zx")
    display = ("deg/h", "deg/h", "arcmin", "arcmin")
    values = np.array([to_si(v, u) for v, u in zip((1.25, -0.5, 0.0, 0.25), display, strict=True)])
    sigmas = np.array([to_si(v, u) for v, u in zip((0.016, 0.02, 0.0, 0.028), display, strict=True)])
    m = 600
    decay = np.exp(-np.arange(m) / 100.0)[:, None]
    return Calibration(
        body_frame="accelerometer_triad",
        model=("gyro_bias", "accel_misalignment"),
        names=names,
        units=("rad/s", "rad/s", "rad", "rad"),
        display_units=display,
        values=values,
        covariance=np.diag(sigmas**2),
        fit={"nis_mean": 1.02, "nis_dof": 900, "held_out_rms": None},
        data={"samples": 60000, "lost": 2, "rejected": 0, "duration_s": 600.0, "stops": 3},
        notes=("2 < 3 & more",),
        history=History(
            t=np.arange(1.0, m + 1),
            value=np.zeros((m, 4)),
            sigma=sigmas * (1.0 + 50.0 * decay),
            attitude_sigma=np.ones((m, 3)),
            stop=np.arange(m) // 200,
            dwell=np.arange(m) % 200 < 150,
            used=np.ones(m, bool),
            nis=np.full((m, 4), 3.0),
        ),
    )


def test_numbers_are_shown_in_customary_units_to_two_digits_of_sigma(calibration):
    table = rows(calibration)
    assert cells(table[0], headings(table)) == ["gyro_bias_x", "1.250", "0.016", "deg/h"]


def test_a_coefficient_fixed_by_the_frame_has_no_sigma(calibration):
    table = rows(calibration)
    assert cells(table[2], headings(table)) == ["accel_misalignment_xy", "0", "fixed", "arcmin"]


def test_a_narrow_terminal_cuts_no_digit(calibration):
    table = rows(calibration, truth=dict.fromkeys(calibration.names, 1e-6))
    console = Console(width=40, file=StringIO())
    console.print(rich_table(table), soft_wrap=True)
    for row in table:
        for text in cells(row, headings(table)):
            assert text in console.file.getvalue()


def test_errors_are_estimate_minus_truth_in_sigmas(calibration):
    table = rows(calibration, truth={"gyro_bias_x": to_si(1.20, "deg/h"), "accel_misalignment_xy": 0.0})
    assert table[0].error == pytest.approx(0.05, rel=1e-9)
    assert table[0].error_sigmas == pytest.approx(0.05 / 0.016, rel=1e-9)
    assert table[1].truth is None
    assert table[2].error_sigmas is None
    assert "error/sigma" in headings(table)
    assert "truth" not in headings(rows(calibration))


def test_published_sigmas_stand_by_their_effect(calibration):
    table = rows(calibration, reference={"gyro_bias": to_si(0.016, "deg/h")})
    assert table[0].reference == pytest.approx(0.016, rel=1e-12)
    assert table[1].reference == table[0].reference
    assert table[3].reference is None


def test_the_longest_effect_name_wins():
    model = ("accel_scale", "accel_scale_cubic")
    names = ("accel_scale_x", "accel_scale_cubic_x")
    assert groups(names, model) == {"accel_scale": [0], "accel_scale_cubic": [1]}
    assert short_name("accel_scale_cubic_x", "accel_scale_cubic") == "x"


def test_the_page_needs_no_network_and_escapes_what_is_not_its_own(calibration):
    text = page(calibration, Contents("<Calibration>"))
    assert "&lt;Calibration&gt;" in text
    assert "2 &lt; 3 &amp; more" in text
    assert not re.search(r"<(script|link|img)[^>]+(src|href)=", text)
    assert len(text) < 6e6


def test_the_page_without_a_history_draws_none(calibration):
    h = calibration.history
    empty = replace(h, **{name: getattr(h, name)[:0] for name in h.__dataclass_fields__})
    text = page(replace(calibration, history=empty), Contents("x"))
    assert "gyro_bias_x" in text
    assert "against time" in page(calibration, Contents("x"))
    assert "against time" not in text


def test_every_free_coefficient_has_a_line_that_ends_at_its_sigma(calibration):
    figure = sigma_history(calibration)
    ends = {trace["name"]: float(trace["y"][-1]) for trace in figure.data}
    assert ends.keys() == set(calibration.names) - {"accel_misalignment_xy"}
    last = calibration.history.sigma[-1, 0] / to_si(1.0, "deg/h")
    # Lines are kept in single precision.
    assert ends["gyro_bias_x"] == pytest.approx(last, rel=1e-6)


def test_the_page_says_why_a_line_ends_below_the_sigma_of_the_table(calibration):
    """A sigma of 2.8 ppm stood above a line that ended at 0.8, and nothing said why."""
    told = "The sigmas of the table are over all models that the data leave open."
    assert told not in page(calibration, Contents("x"))
    averaged = replace(calibration, conditional_sigma=0.5 * np.sqrt(np.diag(calibration.covariance)))
    assert told in page(averaged, Contents("x"))


def test_lines_of_a_panel_differ_without_colour(calibration):
    figure = sigma_history(calibration)
    dashes = [trace["line"]["dash"] for trace in figure.data if trace["name"].startswith("gyro_bias")]
    assert len(set(dashes)) == len(dashes)


def test_bands_lie_where_the_table_turns(calibration):
    assert rotations(calibration.history) == [(150.0, 200.0), (350.0, 400.0), (550.0, 600.0)]


def test_labels_are_pushed_apart_no_further_than_needed():
    heights = np.array([0.0, 0.01, 5.0, 0.02])
    apart = spread(heights, 1.0)
    assert np.array_equal(np.argsort(apart), np.argsort(heights))
    assert np.diff(np.sort(apart)).min() >= 1.0 - 1e-12
    assert apart[2] == 5.0
    assert apart[[0, 1, 3]].mean() == pytest.approx(heights[[0, 1, 3]].mean(), abs=1e-12)


def test_a_page_without_diagnosis_says_where_the_verdict_is(calibration):
    assert "sdimu diagnose" in page(calibration, Contents("x"))


@pytest.mark.parametrize(
    ("value", "sigma", "written"),
    [
        (39.98, 0.96, "39.98 \u00b1 0.96 ppm"),
        (40.04, 1.0, "40.0 \u00b1 1.0 ppm"),
        (-253.4, 42.3, "\u2212253 \u00b1 42 ppm"),
        (0.0995, 0.00571, "0.0995 \u00b1 0.0057 ppm"),
        (1.0, np.inf, "1 \u00b1 inf ppm"),
    ],
)
def test_a_size_goes_as_far_as_two_digits_of_its_sigma(value, sigma, written):
    assert with_sigma(value, sigma, "ppm") == written


def test_a_negative_coefficient_has_the_minus_sign_that_the_text_above_it_has(calibration):
    page = grouped_table(rows(calibration))
    assert "<td>\N{MINUS SIGN}0.500</td>" in page
    assert "<td>-" not in page


@pytest.mark.parametrize(
    ("value", "written"),
    [(1027.4, "1027"), (999.7, "1000"), (3600.0, "3600"), (-1234.0, "-1234"), (43.21, "43.2"), (2e7, "2e+07")],
)
def test_a_number_for_people_has_no_power_of_ten_for_a_thousand(value, written):
    assert three(value) == written
