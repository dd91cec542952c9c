"""Odds of candidates before the data: how usual each is, what it shares with others, what stands beside it."""

from __future__ import annotations

import numpy as np
import pytest

from sdimu_calibration.core.effects.selection import resolve
from sdimu_calibration.core.effects.usual import usual
from sdimu_calibration.core.evidence.candidate import split
from sdimu_calibration.core.posterior.prior import KIN, MEAN_NUMBER, prior_of

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
