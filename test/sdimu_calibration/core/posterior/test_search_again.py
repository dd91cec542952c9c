"""A search about another point begins with what an earlier one told, also where that is no model there."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sdimu_calibration.core.diagnosis.ground import Request, fresh_ground
from sdimu_calibration.core.diagnosis.search import FALSE_ALARM
from sdimu_calibration.core.evidence.wander import Wander
from sdimu_calibration.core.posterior.posterior import posterior


@pytest.fixture(scope="module")
def ground(bench):
    fit = bench.fit(5, (), "recommended")
    return fresh_ground(Request(fit, (), FALSE_ALARM), fit, (), False)


def about(evidence, e):
    """The evidence with other residuals."""
    known = replace(evidence.information, d=evidence.W.T @ e)
    return replace(evidence, e=e, shift=np.zeros(len(evidence.shift)), worked_out=known)


@pytest.mark.parametrize("with_memory", [False, True])
def test_a_size_that_gets_the_wrong_sign_leaves_the_model(ground, bench, with_memory):
    evidence = ground.evidence
    p, allowed = len(evidence.weight), ground.allowed.tolist()
    J, _ = evidence.information.diagonal_given(evidence.model, evidence.weight)
    positive = [c for c in allowed if evidence.candidates[c - p].effect.positive]
    column = max(positive, key=lambda c: J[c] / evidence.information.J[c, c])
    wander: Wander | None = bench.fit(5, (), "recommended").wander if with_memory else None
    noise = np.random.default_rng(7).standard_normal(len(evidence.e))
    shown = evidence.W[:, column] * 20.0 / np.sqrt(J[column])
    first = posterior(about(evidence, noise + shown), ground.allowed, wander)
    family = evidence.candidates[column - p].family
    assert any(first.candidate(k).family == family for k, _ in first.told.members)
    again = posterior(about(evidence, noise - shown), ground.allowed, wander, before=first)
    assert sum(m.probability for m in again.models) == pytest.approx(1.0)
    for model in again.models[:20]:
        sizes = again.board.data(model.noise)[1].at(model.members).sizes
        assert all(
            size >= 0.0 or not again.board.prior.positive[k] for (k, _), size in zip(model.members, sizes, strict=True)
        )
