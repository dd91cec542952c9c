"""Odds of candidates before the data: how usual each is, what it shares with others, what stands beside it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sdimu_calibration.core.diagnosis.candidates import own_equation
from sdimu_calibration.core.diagnosis.diagnose import climb
from sdimu_calibration.core.effects.selection import number_of, of_catalogue, resolve
from sdimu_calibration.core.effects.usual import usual
from sdimu_calibration.core.estimation.solve import solve, with_effects
from sdimu_calibration.core.evidence.candidate import split
from sdimu_calibration.core.posterior.prior import KIN, MEAN_NUMBER, prior_of
from sdimu_calibration.storage.files.config import load_imu, load_model, load_site
from sdimu_calibration.storage.files.effect_file import extended_model
from sdimu_study.worlds import simulated_test

LABELS = ("gyro_delay_y", "gyro_acceleration_sensitivity_yy", "gyro_acceleration_sensitivity_xy", "gyro_bias_wrap_yx")


@pytest.fixture(scope="module")
def candidates():
    (one,) = zip(*(split(resolve(label)) for label in LABELS), strict=True)
    return one


def test_a_delay_is_twice_as_usual_as_what_looks_the_same_and_stands_in_few_data_sheets(candidates):
    share = np.exp(prior_of(candidates).log_share)
    assert share.sum() == pytest.approx(1.0)
    assert share / share[1] == pytest.approx([2.0, 1.0, 1.0, 0.5])
    for delay in ("gyro_delay", "accel_delay", "accel_triad_delay"):
        assert usual(delay) == 2.0


def test_what_acts_on_one_axis_is_likelier_beside_what_acts_on_another(candidates):
    prior = prior_of(candidates)
    alone, beside_another, beside_kin = (prior.log_more(base) for base in ([], [0], [2]))
    # One effect more, whatever it is: a sensor that has some is likelier to have others.
    assert beside_another[3] - alone[3] == pytest.approx(np.log(2.0))
    assert beside_kin[1] - alone[1] == pytest.approx(np.log(2.0) + KIN)
    assert alone == pytest.approx(prior.log_share - np.log1p(1.0 / MEAN_NUMBER))


def test_of_two_that_no_data_tell_apart_a_model_has_one(candidates):
    J = np.eye(4)
    J[0, 1] = J[1, 0] = 1.0
    prior = prior_of(candidates, J=J)
    assert prior.log_more([0])[1] == -np.inf
    assert prior.log_of([0, 1]) == -np.inf
    assert np.isfinite(prior.log_of([0, 2]))


def test_what_was_found_and_is_in_the_model_counts_as_what_is_found(candidates):
    """The odds of the others are those beside it, kin included: to add it changes no probability of them."""
    beside, own = prior_of(candidates), resolve(LABELS[2])
    alone = prior_of([c for k, c in enumerate(candidates) if k != 2], found=(own,))
    # Shares are of what is left; beside it they were of all.
    less = np.log(1.0 - np.exp(beside.log_share[2]))
    for more, same in (([0], [0]), ([1], [1]), ([3], [2]), ([0, 1, 3], [0, 1, 2])):
        given = beside.log_of([2, *more]) - beside.log_of([2])
        assert alone.log_of(same) == pytest.approx(given - less * len(same))
        assert alone.log_more(same[:-1])[same[-1]] == pytest.approx(alone.log_of(same) - alone.log_of(same[:-1]))
    assert alone.of(np.array([1, 2])).log_of([0]) == alone.log_of([1])


def test_what_was_added_was_found_and_what_a_model_lists_is_habit():
    """However its coefficients are spelled: a model with single axes is as sure of nothing missing as a whole one."""
    habit = replace(load_model("baseline"), effects=("gyro_misalignment_xy", "accel_triad_delay", "accel_quadratic"))
    assert habit.found == ()
    more = ("accel_cubic_z", own_equation("gyro_x: ey^2"), "gyro_scale_quadratic", "gyro_bias_warm_up_y(tau=9 s)")
    found = of_catalogue(with_effects(habit, more).found)
    assert [e.family or e.name for e in found] == ["accel_cubic", "gyro_scale_quadratic", "gyro_bias_warm_up"]
    # A whole effect that is added says that some of it was found.
    assert number_of(found) == 3
    model = extended_model("baseline", ["accel_quadratic_z"])
    assert [e.labels for e in of_catalogue(model.found)] == [("accel_quadratic_z",)]


def test_a_certain_effect_that_is_added_changes_no_probability_of_the_others():
    """Beside K2 the drift had 83 %, and 70 % once K2 was in the model."""
    hidden = ("accel_quadratic_z=25 ug/g^2", "gyro_bias_ramp_y=0.05 deg/h/h")
    test, _ = simulated_test("dtg", load_imu("dtg"), "recommended", load_site("daejeon"), 11, hidden)
    model = load_model("baseline")
    found = climb(solve(test, model)).probabilities
    added = climb(solve(test, with_effects(model, ["accel_quadratic_z"]))).probabilities
    of = [{(f.family, f.sensor): f.probability for f in one.families} for one in (found, added)]
    assert of[0].pop(("accel_quadratic", "accel_z")) > 0.99
    for family in of[0].keys() & of[1].keys():
        assert of[1][family] == pytest.approx(of[0][family], abs=0.02), family
    assert max(of[1].values()) > 0.3
