"""The first figure of a fleet: whose dot is where, what the mouse is told, who is named."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sdimu_calibration.cli.fleet import fleet
from sdimu_calibration.core.fleet.population import measured
from sdimu_calibration.core.fleet.study import Candidates, study
from sdimu_calibration.core.units import to_si
from sdimu_calibration.report.fleet.dots import dot_plot
from sdimu_calibration.storage.files.result_file import read_result, write_result

NAMES = ("gyro_bias_x", "gyro_bias_y")
UNITS = dict.fromkeys(NAMES, "deg/h")
NONE = Candidates((), (), np.empty((12, 0)), np.empty((12, 0)), np.empty((12, 0, 0), dtype=np.int8))


def fleet_of(values, sigma=0.01):
    """Studied units; `values`, shape (u, 2), and `sigma` in deg/h."""
    u, scale = len(values), to_si(1.0, "deg/h")
    covariances = np.tile((sigma * scale) ** 2 * np.eye(2), (u, 1, 1))
    serials = [f"SN{k}" for k in range(u)]
    return study(measured(NAMES, scale * values, covariances, serials, np.full(u, np.nan)), ("gyro_bias",), NONE)


@pytest.fixture
def values():
    return np.random.default_rng(3).normal(0.0, 1.0, (12, 2))


def dots_of(done):
    figure = dot_plot(done, UNITS)
    return figure, {
        (text.partition("<br>")[0], y): (float(x), float(far), symbol, text)
        for trace in figure.data
        for x, y, far, symbol, text in zip(
            trace["x"], trace["y"], trace["customdata"], trace["marker"]["symbol"], trace["text"], strict=True
        )
    }


def test_a_unit_that_is_out_does_not_widen_its_own_scale(values):
    clean = dots_of(fleet_of(values[[k for k in range(12) if k != 4]]))[1]
    values[4, 0] = 60.0
    done = fleet_of(values)
    assert [one.unit for one in done.people.out] == ["SN4"]
    dots = dots_of(done)[1]
    assert len(dots) == 24
    # The others are where they are without it, and it is sixty spreads away.
    others = [k for k in range(12) if k != 4]
    assert [dots[f"SN{k}", "gyro_bias_x"][1] for k in others] == pytest.approx(
        [clean[f"SN{n}", "gyro_bias_x"][1] for n in range(11)], rel=1e-5
    )
    spread = np.std(values[others, 0], ddof=1)
    assert dots["SN4", "gyro_bias_x"][1] == pytest.approx((60.0 - values[others, 0].mean()) / spread, rel=1e-2)


def test_what_is_far_is_an_arrow_at_the_edge_and_says_how_far(values):
    values[4, 0], values[7, 1] = 60.0, -60.0
    figure, dots = dots_of(fleet_of(values))
    low, high = figure.axis("x")["range"]
    for unit, name, symbol in (("SN4", "gyro_bias_x", "triangle-right"), ("SN7", "gyro_bias_y", "triangle-left")):
        x, far, drawn, _ = dots[unit, name]
        assert drawn == symbol
        assert low < x < high < abs(far)
        assert any(f"{unit} ({far:+.0f})" in one["text"] and one["y"] == name for one in figure.layout["annotations"])
    # The dots of all others use the width that is there.
    assert high < 5.0


def test_the_mouse_is_told_unit_value_and_sigma(values):
    values[2, 1] = 0.5
    *_, text = dots_of(fleet_of(values))[1]["SN2", "gyro_bias_y"]
    assert text == "SN2<br>gyro_bias_y: 0.500 \N{PLUS-MINUS SIGN} 0.010 deg/h"


def test_a_clean_fleet_names_nobody(values):
    figure, dots = dots_of(fleet_of(np.clip(values, -1.5, 1.5)))
    assert figure.layout["annotations"] == []
    assert {symbol for _, _, symbol, _ in dots.values()} == {"circle-open"}


def test_names_of_neighbours_stand_above_and_below():
    many = np.random.default_rng(5).normal(0.0, 1.0, (30, 2))
    many[3, 0], many[9, 0] = 6.5, 6.6
    figure, dots = dots_of(fleet_of(many))
    assert {unit for (unit, name), dot in dots.items() if dot[2] == "x" and name == "gyro_bias_x"} >= {"SN3", "SN9"}
    shifts = {one["text"]: one["yshift"] for one in figure.layout["annotations"]}
    assert shifts["SN3"] == -shifts["SN9"] != 0


def lines_of(figure):
    """Dashed control limits: (x, y0, y1)."""
    return {(one["x0"], one["y0"], one["y1"]) for one in figure.layout["shapes"] if one["line"].get("dash") == "dash"}


def test_a_coefficient_without_spread_has_no_control_limits(values):
    # Control limits are mean +- 3 spreads: without a spread they are the mean, and no three errors from it.
    values[:, 1] = 0.0
    values[3, 1] = 0.0335
    done = fleet_of(values)
    assert [one.between.spread > 0.0 for one in done.inside.coefficients] == [True, False]
    assert not done.people.out
    figure, dots = dots_of(done)
    assert lines_of(figure) == {(-3.0, -0.5, 0.5), (3.0, -0.5, 0.5)}
    # More than three errors from the mean, and beyond no limit: no name.
    assert dots["SN3", "gyro_bias_y"][1] > 3.0
    assert figure.layout["annotations"] == []
    words = {
        (text.rpartition("<br>")[2].partition(":")[0], template.split()[1])
        for trace in figure.data
        for text, template in zip(trace["text"], trace["hovertemplate"], strict=True)
    }
    assert words == {("gyro_bias_x", "spreads"), ("gyro_bias_y", "errors")}


def test_where_all_coefficients_spread_the_limits_are_as_high_as_the_figure(values):
    assert lines_of(dots_of(fleet_of(values))[0]) == {(-3.0, 0, 1), (3.0, 0, 1)}


def test_the_page_says_of_which_coefficients_there_are_no_limits(batch):
    folder = batch(units=4)
    fleet([folder])
    assert "has no control limits" not in (folder / "fleet.html").read_text()
    paths = sorted(folder.glob("*/result.json"))
    one = read_result(paths[0])
    for path in paths:
        write_result(path, replace(read_result(path), values=one.values))
    fleet([folder])
    assert "no spread is seen has no control limits" in (folder / "fleet.html").read_text()
