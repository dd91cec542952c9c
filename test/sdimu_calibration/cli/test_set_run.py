"""What the page and the table of a set are called: a recording that was refused is not counted, and named."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from sdimu_calibration.cli.next_commands import spelled
from sdimu_calibration.cli.options import FitRequest, StatedOpening
from sdimu_calibration.cli.set_run import SetRequest, page_title, table_heading, the_only, to_repeat
from sdimu_calibration.core.advice import Advice, Kind, Verb
from sdimu_calibration.core.results import Calibration, SetRecording, SetSummary, no_history
from sdimu_calibration.report.page import Contents, page
from sdimu_calibration.storage.files.config import load_imu, load_plan, load_site
from sdimu_sim.bag_file import write_test
from sdimu_sim.core.scenario import Scenario, simulate_test

RESULT = Calibration(
    "prior",
    ("accel_bias",),
    ("accel_bias_x",),
    ("m/s^2",),
    ("ug",),
    np.array([1e-4]),
    np.array([[1e-12]]),
    {"nis_mean": 1.0},
    {},
    (),
    no_history(1),
    of_set=SetSummary((), (), (), np.array([1.0]), ()),
)


def of(used, *refused):
    """A result of some recordings; the refused ones by their names."""
    told = tuple((name, "no samples") for name in refused)
    return replace(RESULT, of_set=SetSummary((None,) * used, (), (), np.array([1.0]), (), told))


@pytest.mark.parametrize(
    ("file", "result", "title"),
    [
        (None, of(2), "Diagnosis of 2 recordings"),
        (None, of(2, "c.mcap"), "Diagnosis of 2 of 3 recordings"),
        (None, of(1), "Diagnosis of 1 recording"),
        (Path("set.yaml"), of(2), "Diagnosis of set.yaml"),
        (Path("set.yaml"), of(2, "c.mcap"), "Diagnosis of set.yaml (2 of 3 recordings)"),
    ],
)
def test_a_title_counts_what_was_used(file, result, title):
    assert page_title(SimpleNamespace(file=file), "Diagnosis", result) == title


def test_the_table_names_what_was_refused():
    assert table_heading(of(2, "c.mcap")).startswith("2 of 3 recordings together, without c.mcap,")
    assert table_heading(of(2)).startswith("2 recordings together, body frame")
    assert table_heading(of(1)).startswith("1 recording, body frame")


@pytest.mark.parametrize(
    ("bags", "file", "of_what"),
    [([Path("a"), Path("b")], None, "a b"), (None, Path("my set.yaml"), "--set 'my set.yaml'")],
)
def test_what_is_advised_repeats_all_that_was_asked(bags, file, of_what):
    opening = StatedOpening(site="daejeon", imu="dtg", gyro_unit="deg/s")
    request = FitRequest(set_file=file, model="mine.yaml", add=["accel_cubic_x"])
    advised = Advice(Kind.KEEP, ("accel_quadratic_z",), Verb.ADD, ("accel_quadratic_z",))
    command = spelled(advised, to_repeat(SetRequest(bags, opening, request), Path("out")))
    assert command == (
        f"sdimu calibrate {of_what} --site daejeon --imu dtg --model mine.yaml --gyro-unit deg/s "
        "--add accel_cubic_x --add 'accel_quadratic_z'"
    )


def test_a_set_file_of_one_recording_is_that_recording(tmp_path):
    """What the file says of it counts as if it was stated; options come before the serial number of the file."""
    plan = load_plan("recommended")
    plan = replace(plan, dwell_s=(20.0, 20.0), turns=plan.turns[:1])
    scenario = Scenario(plan, load_imu("dtg"), load_site("daejeon"), rate_hz=10.0, seed=1, unit=1)
    write_test(tmp_path / "day1", scenario, simulate_test(scenario), custom={"serial": "SN1", "power_on": "3"})
    file = tmp_path / "set.yaml"
    file.write_text(
        "model: hand\nestimator: batch\nsite: daejeon\nimu: dtg\nreference_temperature: 20 degC\n"
        "recordings:\n- {bag: day1, name: first}\n"
    )
    asked = FitRequest(set_file=file, out=Path("out"))
    bag, opening, request = the_only(None, StatedOpening(gyro_unit="deg/s"), asked)
    assert bag == tmp_path / "day1"
    assert (opening.site, opening.imu, opening.gyro_unit) == ("daejeon", "dtg", "deg/s")
    assert (opening.serial, opening.power_on, opening.reference_degc) == ("SN1", "3", 20.0)
    assert request == FitRequest(model="hand", estimator="batch", out=Path("out"))
    _, opening, request = the_only(
        None, StatedOpening(serial="7"), replace(asked, estimator="filter", model="baseline")
    )
    assert (opening.serial, request.estimator, request.model) == ("7", "filter", "baseline")
    file.write_text("recordings:\n- {bag: day1, name: a}\n- {bag: day1, name: b}\n")
    assert the_only(None, StatedOpening(), asked) == SetRequest((), StatedOpening(), asked)


@pytest.mark.parametrize(("names", "said"), [(("day1", "day2"), "day1, day2<"), ("abcdef", "a, b, c, d and others<")])
def test_the_page_says_beside_its_title_which_recordings_it_is_of(names, said):
    assert f'<span class="about grow">{said}' in page(recorded(names), Contents("x"))


def test_the_page_of_one_recording_does_not_compare_it_with_itself():
    heading = "Every coefficient in every recording"
    assert heading in page(recorded(("day1", "day2")), Contents("x"))
    assert heading not in page(recorded(("day1",)), Contents("x"))


def recorded(names):
    """The result of a set of recordings of these names."""
    value = np.array([1e-4])
    parts = tuple(
        SetRecording(name, "", "", 0, np.nan, 60.0, 6000.0, 1.0, value, 0.1 * value, 0.0 * value) for name in names
    )
    return replace(RESULT, of_set=replace(RESULT.of_set, recordings=parts))


def test_the_page_names_it_above_the_table():
    told = replace(RESULT, of_set=replace(RESULT.of_set, left_out=(("c.mcap", "no samples"),)))
    text = page(told, Contents("x"))
    assert text.index("Without c.mcap, which is left out: no samples.") < text.index("accel_bias_x")
