"""Two variants of one effect can be in a model together."""

from __future__ import annotations

import pytest

from sdimu_calibration.core.diagnosis.candidates import catalogue
from sdimu_calibration.core.effects import effect as kinds
from sdimu_calibration.core.effects.imu_model import build, told_apart
from sdimu_calibration.core.effects.selection import resolve
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.storage.files.config import load_imu
from sdimu_calibration.storage.files.effect_file import extended_model

STEPS = ("gyro_bias_step_y(t0=625 s)", "gyro_bias_step_y(t0=670 s)")
NAMES = ("gyro_bias_step_y", STEPS[1], "accel_quadratic_x")


def test_two_steps_of_one_bias_make_a_model_with_two_names() -> None:
    model = build([*STEPS, "accel_quadratic_x"], load_imu("dtg"))
    assert model.names == NAMES
    # The prior is still that of the family.
    assert model.prior[0] == model.prior[1]
    # Told apart once is told apart.
    assert build(model.effects, load_imu("dtg")).names == NAMES


def test_the_same_step_twice_is_refused() -> None:
    with pytest.raises(DataError, match="stands twice"):
        build([STEPS[0], STEPS[0]], load_imu("dtg"))


def test_both_steps_that_are_added_are_in_the_model_and_the_same_one_again_is_refused() -> None:
    effects = extended_model("baseline", [*STEPS, "accel_quadratic_x"]).effects
    assert build(effects, load_imu("dtg")).names[-3:] == NAMES
    with pytest.raises(DataError, match=r"gyro_bias_step_y\(t0=.*is in the model already"):
        extended_model("baseline", [*STEPS, STEPS[1]])


def test_a_step_in_the_model_leaves_other_steps_to_be_found() -> None:
    stops = tuple((k, 200.0 * k, 200.0 * k + 100.0) for k in range(5))
    times = kinds.Timetable(900.0, stops, tuple((k, e, e + 100.0) for k, _, e in stops[:-1]))
    every = {label for e in catalogue(times, set(), False) for label in e.labels if "gyro_bias_step_y" in label}
    (taken, *_) = sorted(every)
    left = {label for e in catalogue(times, {taken}, False) for label in e.labels if "gyro_bias_step_y" in label}
    assert left == every - {taken}
    assert left


def test_names_of_a_result_are_found_again_from_its_effects() -> None:
    again = told_apart([resolve(name) for name in (*STEPS, "accel_quadratic_x")])
    assert tuple(p.name for e in again for p in e.parameters) == NAMES
