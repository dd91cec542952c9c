"""The linear model about a calibration: least squares says the same, whatever is a candidate, about whatever fit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sdimu_calibration.core.effects.effect import Timetable
from sdimu_calibration.core.effects.selection import resolve
from sdimu_calibration.core.evidence.candidate import split
from sdimu_calibration.core.evidence.in_stops import InStops
from sdimu_calibration.core.evidence.linear import LinearEvidence

ROWS, STOPS = 60, 5
KNOWN = ("gyro_bias_x", "gyro_bias_y", "accel_bias_z", "accel_scale_x")
TRIED = ("accel_quadratic_x", "gyro_bias_ramp_x")
RNG = np.random.default_rng(12)
SIGNATURES = {name: RNG.standard_normal(ROWS) for name in (*KNOWN, *TRIED)}


class Given(LinearEvidence):
    """Signatures that do not hang on any recording."""

    def signature(self, effects):
        return np.column_stack([SIGNATURES[c.label] for effect in effects for c in split(effect)])


def candidates(*names):
    return tuple(c for name in names for c in split(resolve(name)))


@pytest.fixture
def evidence(imu):
    """Four coefficients and two candidates; the estimate is off its prior by its sigma."""
    rng = np.random.default_rng(3)
    weight = rng.uniform(0.5, 2.0, len(KNOWN))
    return Given(
        e=3.0 * rng.standard_normal(ROWS),
        W=np.column_stack([SIGNATURES[name] for name in (*KNOWN, *TRIED)]),
        stop=np.arange(ROWS) * STOPS // ROWS,
        names=(*KNOWN, *TRIED),
        weight=weight,
        shift=rng.standard_normal(len(KNOWN)) / np.sqrt(weight),
        stated=1.0 / np.sqrt(weight),
        candidates=candidates(*TRIED),
        prior=np.ones(len(TRIED)),
        imu=imu,
        times=Timetable(100.0, (), ()),
        coefficients=len(KNOWN),
    )


def walks(evidence):
    """Signatures of three modes of noise."""
    return InStops.of(2.0 * np.random.default_rng(8).standard_normal((ROWS, 3)), evidence.stop)


def estimate(evidence, names, weight):
    """Least squares of some parameters by their names, and its sigmas."""
    at = np.array([evidence.names.index(name) for name in names])
    values, covariance = evidence.information.estimate(at, weight)
    return values, np.sqrt(np.diag(covariance))


def test_information_is_that_of_the_rows_and_of_the_prior_about_its_mean(evidence):
    p = len(evidence.weight)
    for noise in (None, walks(evidence)):
        one = evidence.with_noise(noise)
        S = np.eye(ROWS) if noise is None else np.eye(ROWS) + noise.times(np.eye(3)) @ noise.times(np.eye(3)).T
        W, weight = one.W[:, :p], np.diag(one.weight)
        right = np.linalg.solve(
            W.T @ np.linalg.solve(S, W) + weight, W.T @ np.linalg.solve(S, one.e) + weight @ one.shift
        )
        np.testing.assert_allclose(estimate(one, KNOWN, one.weight)[0], right, rtol=1e-9)


def test_effects_that_come_later_are_as_if_they_had_been_there(evidence):
    for noise in (None, walks(evidence)):
        whole = evidence.with_noise(noise)
        later = whole.only(np.zeros(0, dtype=np.int64)).with_effects([resolve(name) for name in TRIED])
        assert later.names == whole.names
        np.testing.assert_allclose(later.information.J, whole.information.J, atol=1e-9)
        np.testing.assert_allclose(later.information.d, whole.information.d, atol=1e-9)


def test_a_coefficient_that_is_a_candidate_has_its_whole_value_as_its_size(evidence):
    """In the same prior nothing moves but the point from which it is counted: its value is minus its shift."""
    at = np.array([1, 3])
    tried = candidates(*(KNOWN[k] for k in at))
    asked = evidence.as_candidates(at, tried)
    stays = [name for k, name in enumerate(KNOWN) if k not in at]
    assert asked.names == (*stays, *(KNOWN[k] for k in at), *TRIED)
    assert asked.coefficients == len(stays)
    order = [KNOWN.index(name) for name in (*stays, *(KNOWN[k] for k in at))]
    before, sigma = estimate(evidence, [KNOWN[k] for k in order], evidence.weight[order])
    after, wide = estimate(asked, [KNOWN[k] for k in order], evidence.weight[order])
    before[len(stays) :] -= evidence.shift[at]
    np.testing.assert_allclose(after, before, rtol=1e-9)
    np.testing.assert_allclose(wide, sigma, rtol=1e-9)


def test_about_a_fit_that_has_a_candidate_in_its_model_the_estimate_stays(evidence):
    """The same recording about coefficients that moved, and a first candidate that was estimated."""
    rng = np.random.default_rng(21)
    moved, size = rng.standard_normal(len(KNOWN)), 0.7
    p = len(KNOWN)
    fresh = replace(
        evidence,
        e=evidence.e - evidence.W[:, :p] @ moved - evidence.W[:, p] * size,
        W=evidence.W[:, : p + 1],
        names=(*KNOWN, TRIED[0]),
        weight=np.append(evidence.weight, 4.0),
        shift=np.append(evidence.shift - moved, -size),
        stated=np.append(evidence.stated, 0.5),
        candidates=(),
        prior=np.zeros(0),
        coefficients=p + 1,
    )
    again = evidence.about(fresh, np.array([p]), candidates(TRIED[0]))
    assert again.names == evidence.names
    names, weight = (*KNOWN, *TRIED), np.append(evidence.weight, [4.0, 1.0])
    before, after = (estimate(one, names, weight)[0] for one in (evidence, again))
    before[:p] -= moved
    np.testing.assert_allclose(after, before, rtol=1e-9)
    # What was worked out is what the rows say.
    np.testing.assert_allclose(again.information.d, replace(again).information.d, atol=1e-9)
