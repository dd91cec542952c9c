"""An error that no effect of the catalogue is comes out as a function of the attitude."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sdimu_calibration.core.diagnosis.ground import Request, fresh_ground
from sdimu_calibration.core.diagnosis.search import FALSE_ALARM, search
from sdimu_calibration.core.noise_term import ATTITUDE, RATE
from sdimu_calibration.core.posterior.told import probabilities
from sdimu_calibration.core.posterior.unknown import unknown_functions

UG = 9.80665e-6
DEG_H = float(np.radians(1.0)) / 3600.0


@pytest.fixture(scope="module")
def drawn(bench):
    """Three draws of a smooth function of the attitude in each accelerometer, of 15 ug."""
    return [with_function(bench, ATTITUDE, slice(3, 6), 15.0 * UG, seed) for seed in (1, 2, 3)]


def with_function(bench, kind, axes, size, seed=1):
    """White noise and a smooth function of what a kind follows in each of some sensors, on signatures of a fit."""
    fit = bench.fit(5, (), "recommended")
    ground = fresh_ground(Request(fit, (), FALSE_ALARM), fit, (), False)
    evidence, wander, rng = ground.evidence, fit.wander, np.random.default_rng(seed)
    root = wander.cut.mode(kind, 0.0)
    error = np.zeros((len(wander.cut), 6))
    error[:, axes] = size * root @ rng.standard_normal((root.shape[1], len(range(*axes.indices(6)))))
    e = rng.standard_normal(len(evidence.e)) + wander.U.times(error.ravel())
    known = replace(evidence.information, d=evidence.W.T @ e)
    seen = replace(evidence, e=e, shift=np.zeros(len(evidence.shift)), worked_out=known)
    return search(seen, ground.allowed, wander), error[:, axes], wander.cut


def test_it_is_told_as_noise_that_follows_the_attitude_and_not_as_effects(drawn):
    for found, _, _ in drawn:
        assert [(term.triad, term.kind) for term in found.noise] == [("accel", ATTITUDE)]
        assert not len(found.chosen)
        assert found.noise[0].size == pytest.approx(15.0 * UG, rel=0.4)


def test_the_function_that_is_drawn_is_the_hidden_one_within_its_band(drawn):
    squares = []
    for found, error, cut in drawn:
        (one,) = unknown_functions(found.posterior, found.noise)
        rest = ~one.turning
        assert one.follows == ATTITUDE
        # Bias, scale factor and misalignment take their share of a function: as weighted least squares over the dwells.
        root = np.sqrt((cut.end - cut.start)[rest])[:, None]
        columns = np.column_stack([np.ones(rest.sum()), one.variable[rest]])
        taken = columns @ np.linalg.lstsq(root * columns, root * error[rest], rcond=None)[0]
        told, hidden = one.mean[rest], error[rest] - taken
        for axis in range(3):
            assert np.corrcoef(told[:, axis], hidden[:, axis])[0, 1] > 0.9
        squares.append(np.mean(((told - hidden) / one.sigma[rest]) ** 2))
    # Nine draws (a function an axis) of some nine degrees of freedom each: the root scatters by .08 about one.
    assert 0.6 < np.sqrt(np.mean(squares)) < 1.4


def test_an_error_of_one_sensor_is_told_of_that_sensor_alone(bench):
    found, _, _ = with_function(bench, ATTITUDE, slice(4, 5), 25.0 * UG)
    (term,) = found.noise
    assert (term.triad, term.kind, term.axes) == ("accel", ATTITUDE, (1,))
    assert term.words == "accel y error that follows the attitude"
    assert term.size == pytest.approx(25.0 * UG, rel=0.4)
    (one,) = unknown_functions(found.posterior, found.noise)
    assert one.axes == (1,)
    assert one.sigma[:, 1].min() > 0.0
    np.testing.assert_array_equal(one.mean[:, [0, 2]], 0.0)
    assert not len(found.chosen)


def test_errors_of_two_sensors_are_told_of_these_two(bench):
    """Of all three they are likelier than of one: the search must not stay there."""
    found, _, _ = with_function(bench, ATTITUDE, slice(3, 5), 25.0 * UG)
    (term,) = found.noise
    assert (term.where, term.kind) == ("accel x and y", ATTITUDE)
    (told,) = [noise for noise in probabilities(found.posterior, found.noise).noise if noise.kind == ATTITUDE]
    assert (told.where, told.axes) == ("accel x and y", (0, 1))
    assert told.probability > 0.95


def test_white_noise_has_none(bench):
    clean = bench.diagnosis()
    assert unknown_functions(clean.found.posterior, clean.found.noise) == ()


def test_an_error_in_turns_that_is_a_function_of_the_rate_is_told_and_drawn_against_the_rate(bench):
    found, error, cut = with_function(bench, RATE, slice(0, 3), DEG_H)
    assert ("gyro", RATE) in {(term.triad, term.kind) for term in found.noise}
    one = next(one for one in unknown_functions(found.posterior, found.noise) if one.follows == RATE)
    np.testing.assert_array_equal(one.variable, cut.conditions.rate)
    turns = cut.turning
    np.testing.assert_allclose(one.mean[~turns], 0.0, atol=1e-3 * DEG_H)
    # Scale factor and misalignment take their share of a function.
    columns = np.column_stack([np.ones(turns.sum()), one.variable[turns]])
    told, hidden = (v - columns @ np.linalg.lstsq(columns, v, rcond=None)[0] for v in (one.mean[turns], error[turns]))
    assert np.corrcoef(told.ravel(), hidden.ravel())[0, 1] > 0.9
