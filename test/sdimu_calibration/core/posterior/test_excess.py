"""Where no noise model is right, what the data decide is decided by what they leave."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sdimu_calibration.core.diagnosis.ground import Request, fresh_ground
from sdimu_calibration.core.diagnosis.search import FALSE_ALARM
from sdimu_calibration.core.posterior import told
from sdimu_calibration.core.posterior.posterior import posterior
from sdimu_calibration.core.posterior.told import probabilities

VARIANCE = 2.0


@pytest.fixture(scope="module")
def ground(bench):
    fit = bench.fit(5, (), "recommended")
    return fresh_ground(Request(fit, (), FALSE_ALARM), fit, (), False)


def drawn(evidence, W, e):
    """The evidence with other signatures and residuals, and nothing known of the coefficients but their sigmas."""
    known = replace(evidence.information, J=W.T @ W, d=W.T @ e)
    return replace(evidence, W=W, e=e, shift=np.zeros(len(evidence.shift)), worked_out=known)


@pytest.fixture(scope="module")
def residuals(ground):
    """Noise of twice the variance that is stated, and an effect of 6 sigma of the stated noise."""
    evidence = ground.evidence
    column = evidence.names.index("accel_quadratic_x")
    J, _ = evidence.information.diagonal_given(evidence.model, evidence.weight)
    noise = np.random.default_rng(11).standard_normal(len(evidence.e))
    return np.sqrt(VARIANCE) * noise + evidence.W[:, column] * 6.0 / np.sqrt(J[column])


def test_a_variance_that_the_noise_lacks_is_found_and_weighs_as_if_it_were_stated(ground, residuals):
    evidence = ground.evidence
    found = posterior(drawn(evidence, evidence.W, residuals), ground.allowed, None)
    assert found.board.excess == pytest.approx(VARIANCE, rel=0.1)
    root = np.sqrt(found.board.excess)
    stated = posterior(drawn(evidence, evidence.W / root, residuals / root), ground.allowed, None)
    assert stated.board.excess == pytest.approx(1.0, abs=0.01)
    ours, right = ({(f.family, f.sensor): f.probability for f in probabilities(p).families} for p in (found, stated))
    assert right["accel_quadratic", "accel_x"] > 0.1
    for family in right.keys() | ours.keys():
        assert ours.get(family, 0.0) == pytest.approx(right.get(family, 0.0), abs=0.03), family


def test_noise_as_stated_has_no_excess(ground):
    evidence = ground.evidence
    noise = np.random.default_rng(12).standard_normal(len(evidence.e))
    assert posterior(drawn(evidence, evidence.W, noise), ground.allowed, None).board.excess < 1.06


def test_every_member_that_is_told_has_a_size_however_few_models_are_worked_out(ground, residuals, monkeypatch):
    evidence = ground.evidence
    found = posterior(drawn(evidence, evidence.W, residuals), ground.allowed, None)
    monkeypatch.setattr(told, "_MOST", 1)
    members = [m for family in probabilities(found).families for m in family.members]
    assert len(members) > len(found.models[0].members)
    assert np.isfinite([(m.value, m.sigma) for m in members]).all()
