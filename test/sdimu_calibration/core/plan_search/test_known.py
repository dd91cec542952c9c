"""What is known already counts, and only what a plan tells beyond it is its gain."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sdimu_calibration.core.effects import body_frame
from sdimu_calibration.core.estimation.prepared_test import PreparedTest
from sdimu_calibration.core.estimation.solve import solve
from sdimu_calibration.core.evidence.known import data_information, in_frame_of_priors, known_from
from sdimu_calibration.core.plan import Plan
from sdimu_calibration.core.plan_search import Goal, Known, Question, gain, known_of, next_turn, search
from sdimu_calibration.core.plan_search.bound import already, bounds
from sdimu_calibration.core.plan_search.known import together
from sdimu_calibration.core.plan_search.moves import Abilities
from sdimu_calibration.core.planning.nominal import nominal_recording
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.storage.files.config import load_imu, load_plan, load_site
from sdimu_calibration.storage.files.model_choice import named_model

OPEN = ("gyro_scale_asymmetry_y", "gyro_scale_quadratic_y")
BASELINE = Question(load_site("daejeon"), load_imu("dtg"), named_model("baseline", ()))
ASKED = replace(BASELINE, model=named_model("baseline", OPEN))
KIM18, RECOMMENDED = load_plan("kim18"), load_plan("recommended")


@pytest.fixture(scope="module")
def told():
    return bounds(KIM18, ASKED)


@pytest.fixture(scope="module")
def known(told) -> Known:
    J = data_information(told.covariance, told.prior) / np.outer(told.prior, told.prior)
    return Known(told.names, J, told.prior, np.zeros(len(told.prior)))


def with_biases_anew(known: Known, share: float) -> Known:
    scatter = [share * p if "bias" in name else 0.0 for name, p in zip(known.names, known.prior, strict=True)]
    return replace(known, scatter=np.array(scatter))


def test_what_a_plan_told_is_known_after_it(told, known):
    before = already(replace(ASKED, known=known))
    np.testing.assert_allclose(before.sigma, told.sigma, rtol=1e-6, atol=1e-9 * told.sigma.max())


def test_information_adds_up_and_deviations_of_a_power_on_are_eliminated(told, known):
    """Against a dense least squares with the values of the unit and all deviations as parameters."""
    anew = with_biases_anew(known, 0.3)
    p = len(told.prior)
    J = data_information(told.covariance, told.prior)
    varies = np.flatnonzero(anew.scatter)
    pick = np.eye(p)[:, varies] * (anew.scatter / told.prior)[varies]
    both = np.hstack([np.eye(p), pick])
    dense = both.T @ J @ both
    dense[:p, :p] += J + np.eye(p)
    dense[p:, p:] += np.eye(len(varies))
    expected = np.linalg.inv(dense)[:p, :p] * np.outer(told.prior, told.prior)
    found = together(anew, told.names, told.prior, told.covariance)
    np.testing.assert_allclose(np.sqrt(np.diag(found)), np.sqrt(np.diag(expected)), rtol=1e-6)


def test_coefficients_that_a_plan_does_not_estimate_are_estimated_along(told, known):
    """Leaving the class out of the question makes nothing better known than it is with the class open."""
    narrow = already(replace(BASELINE, known=known))
    p = len(narrow.names)
    wide = together(known, told.names, told.prior, None)[:p, :p]
    assert told.names[:p] == narrow.names
    np.testing.assert_allclose(np.sqrt(np.diag(narrow.covariance)), np.sqrt(np.diag(wide)), rtol=1e-6)


def test_gain_is_the_same_in_any_units_and_zero_for_nothing(told):
    C = told.covariance
    D = np.diag(10.0 ** np.linspace(-6, 6, len(C)))
    assert gain(C, C) == 0.0
    assert gain(C, 0.25 * C) == pytest.approx(len(C) * np.log(2.0))
    assert gain(D @ C @ D, 0.25 * D @ C @ D) == pytest.approx(gain(C, 0.25 * C))


def test_the_same_plan_again_tells_less_than_one_that_closes_the_class(known):
    before = already(replace(ASKED, known=known)).covariance
    again, other = (gain(before, bounds(plan, replace(ASKED, known=known)).covariance) for plan in (KIM18, RECOMMENDED))
    assert other > again > 0.0


def test_new_biases_never_tell_more(known):
    before = already(replace(ASKED, known=known)).covariance
    gains = [
        gain(before, bounds(RECOMMENDED, replace(ASKED, known=with_biases_anew(known, share))).covariance)
        for share in (0.0, 0.1, 1.0)
    ]
    assert gains[0] > gains[1] > gains[2] > 0.0


def test_the_next_recording_closes_what_is_open_by_another_rate(known):
    asked = replace(ASKED, known=with_biases_anew(known, 1.0))
    stay = Plan("next", (100.0,), (), RECOMMENDED.acceleration_rad_s2)
    best = next_turn(stay, asked, OPEN)[0]
    assert {turn.axis for turn in best.turns} == {"Y"}
    assert max(turn.rate_rad_s for turn in best.turns) == pytest.approx(np.radians(10.0))
    assert best.after > 5.0 * best.before


def test_a_search_without_limits_finds_what_tells_more_in_the_same_time(known):
    asked = replace(ASKED, known=with_biases_anew(known, 1.0))
    able = Abilities((np.radians(2.0), np.radians(10.0)), np.radians(20.0), (20.0, 60.0, 100.0))
    minutes = KIM18.duration_s / 60.0
    found = search(KIM18, asked, able, Goal({}, minutes), tries=8)
    assert found.minutes <= minutes
    before = already(asked).covariance
    assert gain(before, found.bounds.covariance) > gain(before, bounds(KIM18, asked).covariance)
    with pytest.raises(DataError, match="goal"):
        search(KIM18, asked, able, Goal({}))


def test_a_fit_and_its_report_know_what_its_covariance_says():
    recording = nominal_recording(KIM18, BASELINE.site)
    fit = solve(PreparedTest(recording, BASELINE.imu, BASELINE.site), BASELINE.model, "filter")
    of_evidence = in_frame_of_priors(known_of(fit.evidence(), np.empty(0, dtype=np.int64)), fit.sensors)
    sensors = fit.sensors
    F = body_frame.frame_jacobian(sensors.names, BASELINE.model.body_frame)
    of_report = known_from(fit.names, fit.covariance, sensors.prior, F)
    free = np.diag(fit.covariance) > 0.0
    for known in (of_evidence, of_report):
        sigma = already(replace(BASELINE, known=known)).sigma
        np.testing.assert_allclose(sigma[free], np.sqrt(np.diag(fit.covariance))[free], rtol=1e-3)
