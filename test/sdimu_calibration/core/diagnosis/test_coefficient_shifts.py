"""What hangs on a choice is what two calibrations differ by, and nothing is said where they do not."""

from __future__ import annotations

import numpy as np
import pytest

from sdimu_calibration.core.diagnosis.coefficient_shifts import coefficient_shifts
from sdimu_calibration.core.diagnosis.found import found_effects
from sdimu_calibration.core.diagnosis.problem import Problem
from sdimu_calibration.core.estimation.solve import extend

_HIDDEN = ("accel_scale_asymmetry_z=60 ppm",)


def _refit(bench, diagnosis, label):
    (candidate,) = (c for c in diagnosis.evidence.candidates if c.label == label)
    fit = extend(bench.fit(effects=_HIDDEN), [candidate.effect])
    return fit.estimate, np.sqrt(np.diag(fit.estimate_covariance))


def test_a_stake_is_the_difference_of_two_calibrations(bench):
    diagnosis = bench.diagnosis(effects=_HIDDEN)
    (column,) = (int(i) for i in diagnosis.found.chosen)
    other = diagnosis.evidence.names.index("accel_quadratic_z")
    (stake,) = coefficient_shifts(Problem(diagnosis.evidence), [column], column, [other])
    named, sigma = _refit(bench, diagnosis, "accel_scale_asymmetry_z")
    instead, _ = _refit(bench, diagnosis, "accel_quadratic_z")
    k = diagnosis.evidence.names.index(stake.coefficient)
    assert stake.other == "accel_quadratic_z"
    assert (instead[k] - named[k]) / sigma[k] == pytest.approx(stake.sigmas, rel=0.05)


def test_nothing_hangs_on_a_choice_that_the_data_make(bench):
    (one,) = found_effects(bench.diagnosis(effects=_HIDDEN))
    assert one.alike == ()
    assert one.coefficient_shifts == ()


def test_a_step_says_how_far_coefficients_move_in_the_sense_of_a_refit(diagnosis):
    """After less before, as the ladder of refits says it."""
    (step,) = diagnosis.found.steps
    before, after = diagnosis.before, diagnosis.after
    sigma = before.conditional_sigma if before.conditional_sigma is not None else np.sqrt(np.diag(before.covariance))
    moved = {
        name: (after.values[after.names.index(name)] - before.values[k]) / sigma[k]
        for k, name in enumerate(before.names)
        if sigma[k] > 0.0
    }
    told = [(name, size) for name, size in step.moved if abs(size) > 3.0 and name in moved]
    assert told
    for name, size in told:
        assert np.sign(size) == np.sign(moved[name])
        assert size == pytest.approx(moved[name], rel=0.3)
