"""A running test is told in place in a terminal, and by one plain line a stop anywhere else."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from io import StringIO

import numpy as np
import pytest
from rich.console import Console

from sdimu_calibration.cli.watch import Watch
from sdimu_calibration.core.units import to_si
from sdimu_calibration.report.live_seen import Outline
from sdimu_calibration.report.live_text import SeenDiagnosis
from sdimu_calibration.report.progress_text import falling, light

BIAS, SCALE = to_si(1.0, "deg/h"), to_si(150.0, "ppm")
TEST = Outline(900.0, 4, ("gyro_bias", "gyro_scale"), {"gyro_bias_x": "deg/h", "gyro_scale_x": "ppm"})


@dataclass(frozen=True)
class Now:
    stop: int = 1
    phase: str = "dwell"
    table_s: float = 300.0
    sigmas: dict[str, float] = field(default_factory=lambda: {"gyro_bias_x": 0.01 * BIAS, "gyro_scale_x": 0.5 * SCALE})
    first: dict[str, float] = field(default_factory=lambda: {"gyro_bias_x": BIAS, "gyro_scale_x": SCALE})
    nis: dict[str, float] = field(default_factory=lambda: {"rate": 1.02, "force": 0.99})
    verdict: str = "consistent"
    diagnosis: SeenDiagnosis = field(default_factory=SeenDiagnosis)


def told(terminal: bool, *shown: tuple[Now, bool], awaited: tuple[str, ...] = ()) -> str:
    console = Console(file=StringIO(), force_terminal=terminal, width=200, color_system=None)
    with Watch(console, TEST, awaited) as watch:
        for now, streaming in shown:
            watch.show(now, streaming, 3.0)
    return console.file.getvalue()


@pytest.mark.parametrize("terminal", [True, False])
def test_stop_phase_time_left_sigmas_and_light_are_told(terminal):
    text = told(terminal, (Now(), True))
    # 300 s of data in 3 s: the 600 s that are left take 6 s.
    for word in (
        "stop 1 of 3 dwell",
        "300 of 900 s",
        "6 s left at 100 times real time",
        "75 ppm",
        "50 %",
        "rate 1.02",
        "consistent",
    ):
        assert word in text


def test_a_pipe_gets_one_plain_line_a_stop():
    lines = told(False, *((replace(Now(), stop=stop), True) for stop in (0, 0, 1, 1, 1, 2))).splitlines()
    assert [line.split(" of ")[0] for line in lines] == ["stop 0", "stop 1", "stop 2"]
    assert "\x1b" not in "".join(lines)


def test_a_pipe_gets_nothing_before_there_is_an_estimate():
    assert told(False, (replace(Now(), sigmas={}, first={}, nis={}), True)) == ""


def test_the_last_calibration_is_told_apart():
    text = told(True, (Now(), False))
    assert "last calibration" in text
    assert "left at" not in text  # the pace is that of the samples, which have ended


def test_the_light_differs_in_shape_too():
    fine, alarm = light({"rate": 1.0}, "consistent"), light({"rate": 3.0}, "inconsistent: rate 3.00 of 1")
    assert fine[0] != alarm[0]
    assert "inconsistent: rate 3.00 of 1" in alarm


def test_what_has_fallen_least_comes_first():
    now = Now()
    fallen = falling(now.first, now.sigmas, TEST.units, TEST.effects)
    assert [(f.effect, f.share) for f in fallen] == [("gyro_scale", 0.5), ("gyro_bias", pytest.approx(0.01))]
    assert fallen[1].sigma == pytest.approx(0.01)


MISFIT = SeenDiagnosis(
    3,
    "misfit",
    "2 candidates stand out of the noise, asymmetry most.",
    "noise reaches 3.82",
    (("asymmetry", "+27.4 sigma, 41 ppm"), ("quadratic", "+12.1 sigma, 3 ppm")),
    (("as given", "2.42"), ("+ asymmetry", "0.98")),
    ("gyro_x", "gyro_y"),
    ("0", "1", "2", "3"),
    np.array([[0.4, -4.2, 0.1, np.nan], [0.0, 1.0, 11.7, -2.9]]),
)


def test_heat_map_ranking_and_ladder_are_shown():
    text = told(True, (Now(diagnosis=MISFIT), True))
    for word in ("asymmetry most", "gyro y", "+12", "-4", "noise reaches 3.82", "+27.4 sigma, 41 ppm", "2.42", "0.98"):
        assert word in text
    assert "-3" not in text  # below three sigma a cell is a dot


def test_a_pipe_gets_one_line_a_diagnosis():
    waiting = SeenDiagnosis(0, "waiting", "no diagnosis yet: too few samples have come")
    lines = told(False, (Now(diagnosis=waiting), True), (Now(diagnosis=MISFIT), True), (Now(diagnosis=MISFIT), False))
    found = [line for line in lines.splitlines() if line.startswith("diagnosis")]
    assert found == [
        "diagnosis of stop 0: waiting: no diagnosis yet: too few samples have come",
        "diagnosis of stop 3: misfit: 2 candidates stand out of the noise, asymmetry most; "
        "asymmetry +27.4 sigma, 41 ppm, quadratic +12.1 sigma, 3 ppm (noise reaches 3.82); "
        "error with one stop left out: as given 2.42, + asymmetry 0.98",
    ]


@pytest.mark.parametrize("terminal", [True, False])
def test_a_line_says_when_the_filter_has_what_was_added(terminal):
    more = replace(Now(), sigmas={**Now().sigmas, "gyro_scale_asymmetry_y": SCALE})
    line = "gyro_scale_asymmetry_y is in the model\n"
    assert line not in told(terminal, (Now(), True), (Now(), True)).replace("\r", "")
    assert told(terminal, (Now(), True), (more, True), (more, True)).replace("\r", "").count(line) == 1
    # Not of one that had it before somebody watched, unless it is the one who adds it.
    assert line not in told(terminal, (more, True))
    assert line in told(terminal, (more, True), awaited=("gyro_scale_asymmetry_y",))
