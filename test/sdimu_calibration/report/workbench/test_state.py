"""States of a page: plain data, every step can be undone, nothing else is kept."""

from __future__ import annotations

import json

import numpy as np
import pytest

from sdimu_calibration.core.evidence.consistency import CHANNEL_NAMES
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.report.data import Grid
from sdimu_calibration.report.workbench.figures import heat_map
from sdimu_calibration.report.workbench.fit import Missing
from sdimu_calibration.report.workbench.own_effect import stated_priors
from sdimu_calibration.report.workbench.parts import verdict
from sdimu_calibration.report.workbench.setting import Setting
from sdimu_calibration.report.workbench.state import State, from_json
from sdimu_calibration.report.workbench.steps import step


def test_undo_goes_back_through_every_step():
    steps = [State()]
    for move in (lambda s: s.add("a"), lambda s: s.add("b"), lambda s: s.hold((3, 1)), lambda s: s.drop("a")):
        steps.append(move(steps[-1]))
    state = steps[-1]
    assert (state.now.added, state.now.held) == (("b",), (1, 3))
    for before in reversed(steps[:-1]):
        state = state.undo()
        assert (state.now, state.past) == (before.now, before.past)
    assert state.undo() is state
    for after in steps[1:]:
        state = state.redo()
        assert (state.now, state.past) == (after.now, after.past)
    assert state.redo() is state


def test_a_reload_of_the_page_loses_nothing():
    state = State().add("a").add("own: 1\nname: x").hold((4,)).look(8, 2)
    state = state.then(state.now.without_span(3.0, 4.5).with_prior("a_x", "1 ppm", "0 ppm")).undo()
    assert from_json(json.loads(json.dumps(state.as_json()))) == state


def test_what_is_no_state_is_a_fresh_page():
    assert from_json(None) == from_json("x") == State()


def test_steps_that_change_nothing_are_no_steps():
    state = State().add("a")
    assert state.add("a") is state
    assert state.drop("b") is state
    assert state.hold(()) is state


def test_spans_that_touch_become_one_and_are_cut_where_points_come_back():
    setting = Setting().without_span(10.0, 12.0).without_span(20.0, 21.0).without_span(12.0, 13.0)
    assert setting.cut == ((10.0, 13.0), (20.0, 21.0))
    assert setting.with_span(11.0, 12.0).cut == ((10.0, 11.0), (12.0, 13.0), (20.0, 21.0))
    assert setting.with_span(0.0, 30.0).cut == ()


def test_the_priors_of_an_effect_go_with_it():
    own = "format: sdimu-effect/1\nname: bent\n"
    state = State().add("gyro_drift").add(own)
    setting = state.now
    for name in ("gyro_bias_x", "gyro_drift_x", "bent_k"):
        setting = setting.with_prior(name, "0 ppm", "1 ppm")
    state = state.then(setting)
    assert [name for name, _, _ in state.drop(own).now.priors] == ["gyro_bias_x", "gyro_drift_x"]
    assert [name for name, _, _ in state.drop("gyro_drift").now.priors] == ["bent_k", "gyro_bias_x"]
    assert [name for name, _, _ in state.now.rung(0).priors] == ["gyro_bias_x"]


def test_the_model_as_given_has_no_prior_of_a_user_and_the_same_measurements():
    setting = Setting(("gyro_drift",), held=(3,)).without_span(1.0, 2.0).with_prior("accel_bias_y", "110 ug", "5 ug")
    assert setting.given == Setting(held=(3,), cut=((1.0, 2.0),))


def test_a_page_sends_no_more_than_its_last_hundred_steps():
    state = State()
    for stop in range(150):
        state = state.hold((stop,))
    assert len(state.past) == 100
    assert state.undo().now.held == (148,)


def test_a_sigma_without_a_unit_has_that_of_the_value():
    controls = {"coefficient": "accel_bias_z", "mean": "110 ug", "sigma": "5"}
    assert step(State(), "set-prior", controls).now.priors == (("accel_bias_z", "110 ug", "5 ug"),)
    own = {**controls, "sigma": "0.005 mg"}
    assert step(State(), "set-prior", own).now.priors == (("accel_bias_z", "110 ug", "0.005 mg"),)


@pytest.mark.parametrize(
    ("adequate", "mended", "objections", "tone"),
    [
        (True, False, (), "good"),
        (True, False, ("a",), "doubtful"),
        (False, True, (), "doubtful"),
        (False, False, (), "bad"),
    ],
)
def test_red_is_for_what_no_effect_mends(adequate, mended, objections, tone):
    missing = Missing((), 4.0, adequate, "x", None, None, mended=mended)
    assert verdict(missing, objections)[1] == f"verdict {tone}"


def test_numbers_of_many_stops_do_not_run_into_each_other():
    """28 stops in the column of the map: signs of what stands out stand in the cells, numbers under the mouse."""
    value = np.full((len(CHANNEL_NAMES), 28), 1.5)
    value[6, 3] = -4.2
    drawn = heat_map(Grid(np.arange(28), value), (6, 3)).data[0]
    texts = {text for row in drawn["text"] for text in row}
    assert texts == {"", "\N{MINUS SIGN}"}
    assert "%{z" in drawn["hovertemplate"]
    few = heat_map(Grid(np.arange(19), value[:, :19]), (6, 3)).data[0]
    assert few["text"][6][3] == "\N{MINUS SIGN}4.2"


@pytest.mark.parametrize(
    ("mean", "sigma", "message"),
    [
        ("abc", "5", "value of accel_bias_y: 'abc' is not a number with a unit (expected something like '1 ug')"),
        ("110 ug", "abc", "sigma of accel_bias_y: 'abc ug' is not a number with a unit (expected something like"),
        ("", "5", "value of accel_bias_y: it is empty (write a number with its unit, such as '1 ug')"),
        ("110 ug", "", "sigma of accel_bias_y: it is empty (write a number with its unit, such as '1 ug')"),
        ("110", "5", "value of accel_bias_y: '110' has no unit (expected something like '110 ug')"),
        ("110 deg/h", "5", "value of accel_bias_y: '110 deg/h' has the wrong unit (expected something like '1 ug')"),
        ("110 ug", "-5", "sigma of accel_bias_y: '-5 ug' is below zero"),
    ],
)
def test_a_wrong_prior_is_told_by_its_field_with_an_example_in_the_unit_of_the_coefficient(mean, sigma, message):
    controls = {"coefficient": "accel_bias_y", "mean": mean, "sigma": sigma}
    wanted = step(State(), "set-prior", controls).now.priors
    with pytest.raises(DataError) as caught:
        stated_priors((), wanted, {"accel_bias_y": "ug"})
    assert message in str(caught.value)


def test_a_prior_of_a_coefficient_that_is_gone_is_told_by_name():
    with pytest.raises(DataError, match="prior of bent: the model has no such coefficient"):
        stated_priors((), [("bent", "1 ug", "1 ug")], {"accel_bias_y": "ug"})


@pytest.mark.parametrize(
    ("mean", "sigma", "read"),
    [
        ("110 ug", "5", ("110 ug", "5 ug")),
        ("110ug", "5ug", ("110 ug", "5 ug")),
        ("1.5e-3deg/h", "2e-4", ("1.5e-3 deg/h", "2e-4 deg/h")),
        ("20%", "1 %", ("20 %", "1 %")),
    ],
)
def test_a_unit_stands_behind_its_number_with_one_blank(mean, sigma, read):
    controls = {"coefficient": "c", "mean": mean, "sigma": sigma}
    assert step(State(), "set-prior", controls).now.priors == (("c", *read),)
