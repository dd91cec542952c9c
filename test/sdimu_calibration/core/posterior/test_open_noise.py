"""What the data leave open between kinds of noise is told as open, in each triad."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sdimu_calibration.core.diagnosis.ground import Request, fresh_ground
from sdimu_calibration.core.diagnosis.search import FALSE_ALARM, in_every_noise, search
from sdimu_calibration.core.evidence.noise_root import root_of
from sdimu_calibration.core.noise_term import RANDOM_WALK, TRIADS, NoiseTerm


@pytest.fixture(scope="module")
def found(searched):
    return searched.posterior


@pytest.fixture(scope="module")
def searched(bench):
    """A random walk in both triads, of a size that is seen and no more, on the signatures of a fit."""
    fit = bench.fit(5, (), "recommended")
    ground = fresh_ground(Request(fit, (), FALSE_ALARM), fit, (), False)
    evidence, wander, rng = ground.evidence, fit.wander, np.random.default_rng(5)
    scale = [3e-9, 5e-7]
    root = root_of([NoiseTerm(triad, RANDOM_WALK, size=s) for triad, s in zip(TRIADS, scale, strict=True)], wander.cut)
    error = root @ rng.standard_normal((2, root.shape[1] // 6, 3)).transpose(0, 2, 1).ravel()
    e = rng.standard_normal(len(evidence.e)) + wander.U.times(error)
    known = replace(evidence.information, d=evidence.W.T @ e)
    seen = replace(evidence, e=e, shift=np.zeros(len(evidence.shift)), worked_out=known)
    return search(seen, ground.allowed, wander)


def shares(noises):
    """Probability of each kind in each triad of noises with weights."""
    total = sum(p for p, _ in noises)
    out = {}
    for p, noise in noises:
        for triad, kind in {(t.triad, t.kind) for t in noise.terms}:
            out[triad, kind] = out.get((triad, kind), 0.0) + p / total
    return out


def test_each_kind_has_the_probability_that_it_has_beside_the_best_effects(found):
    beside = found.board.noises(found.best.members)
    best = max(score for score, _ in beside)
    alone = shares([(np.exp(score - best), noise) for score, noise in beside])
    open_ones = {key for key, p in alone.items() if 0.03 < p < 0.9}
    assert {triad for triad, _ in open_ones} == set(TRIADS)
    for triad, kind in open_ones:
        assert found.of_noise(triad, [kind]) == pytest.approx(alone[triad, kind], abs=0.05), (triad, kind)


def test_probabilities_of_all_noises_add_to_one(found):
    assert sum(p for _, p in found.noises) == pytest.approx(1.0)
    assert {m.noise.kinds for m in found.models} <= {noise.kinds for noise, _ in found.noises}


def test_a_search_that_goes_on_from_one_noise_weighs_all_kinds_in_the_end(searched):
    """As the test of each kind above, of a search that looked for the kinds of the likeliest noise alone."""
    window = searched.posterior
    beside = window.board.noises(window.best.members)
    best = max(score for score, _ in beside)
    alone = shares([(np.exp(score - best), noise) for score, noise in beside])
    one = replace(window, noises=window.noises[:1])
    evidence, board = searched.white, window.board
    on = search(evidence, board.allowed, board.wander, earlier=replace(searched, posterior=one))
    open_ones = {key for key, p in alone.items() if 0.03 < p < 0.9}
    assert any(on.posterior.of_noise(triad, [kind]) == 0.0 for triad, kind in open_ones)
    ended = in_every_noise(on).posterior
    for triad, kind in open_ones:
        assert ended.of_noise(triad, [kind]) == pytest.approx(alone[triad, kind], abs=0.05), (triad, kind)
    assert sum(p for _, p in ended.noises) == pytest.approx(1.0)


def test_a_noise_in_two_sizes_counts_once_beside_each_set_of_effects(searched):
    """A search from one noise looks at it in the size that it has beside no other, too."""
    window = searched.posterior
    one = replace(window, noises=window.noises[:1])
    on = search(searched.white, window.board.allowed, window.board.wander, earlier=replace(searched, posterior=one))
    held = [(model.noise.key, model.members) for model in on.posterior.models]
    assert len(set(held)) == len(held)
    # Both sizes were looked at: beside other effects the other one is the likelier.
    assert len({model.noise for model in on.posterior.models}) > len({key for key, _ in held})
