"""Worlds as the prior has them: number and size of effects and of noise, and that the simulator makes them."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

from sdimu_calibration.core.noise_term import TRIADS, NoiseTerm
from sdimu_calibration.core.posterior.noise_models import MARKOV_S, MARKOV_SPREAD, ODDS, usual_sizes
from sdimu_calibration.storage.files.config import load_imu
from sdimu_sim.core.coloured import KINDS, parse_noise
from sdimu_sim.core.hidden import one_sided, parse_effects
from sdimu_study.believed import BelievedEffects, believed_count, believed_noise

WORLDS = 4000


def test_as_many_effects_are_drawn_as_the_prior_believes():
    rng = np.random.default_rng(1)
    counts = np.bincount([believed_count(rng) for _ in range(WORLDS)], minlength=4)
    # A rate that is exponential with mean 2 gives a geometric number: a third has none.
    for number in range(4):
        share = (1.0 / 3.0) * (2.0 / 3.0) ** number
        assert abs(counts[number] - share * WORLDS) < 4.0 * np.sqrt(WORLDS * share * (1.0 - share))


def test_each_kind_of_noise_is_as_frequent_and_as_large_as_the_prior_believes():
    imu, rng = load_imu("mems_industrial"), np.random.default_rng(2)
    usual = usual_sizes(imu)
    drawn = [[parse_noise(text) for text in believed_noise(imu, 1e9, rng)] for _ in range(WORLDS)]
    kinds = [Counter(key.triad for key in one) for one in drawn]
    assert max(max(one.values(), default=0) for one in kinds) == 2
    for triad in TRIADS:
        # Odds beside none, of what has none or that kind alone.
        alone = Counter(
            own[0].kind if own else "none"
            for one in drawn
            if len(own := [key for key in one if key.triad == triad]) < 2
        )
        for kind in KINDS:
            expected = ODDS[kind] * alone["none"]
            assert abs(alone[kind] - expected) < 4.0 * np.sqrt(expected * (1.0 + ODDS[kind]))
            off = [
                np.log(key.size / usual.centre[triad, kind]) / usual.spread[triad, kind]
                for one in drawn
                for key in one
                if (key.triad, key.kind) == (triad, kind)
            ]
            assert abs(np.mean(off)) < 4.0 / np.sqrt(len(off))
            assert abs(np.std(off) - 1.0) < 4.0 / np.sqrt(2.0 * len(off))
    late = [np.log(key.tau / MARKOV_S) / MARKOV_SPREAD for one in drawn for key in one if key.kind == "markov"]
    assert abs(np.mean(late)) < 4.0 / np.sqrt(len(late))
    assert abs(np.std(late) - 1.0) < 4.0 / np.sqrt(2.0 * len(late))
    short = [parse_noise(text) for _ in range(500) for text in believed_noise(imu, 600.0, rng)]
    assert 100.0 < max(key.tau for key in short) <= 200.0


def test_effects_are_drawn_of_the_prior_and_the_simulator_reads_them(fit):
    rng, left_out = np.random.default_rng(3), "gyro_scale_asymmetry"
    draw, drawn, of_size, families, worlds = BelievedEffects(rng, (), {left_out}), [], [], Counter(), 400
    for _ in range(worlds):
        draw._places.clear()
        drawn += [draw(fit) for _ in range(3)]
        (board, sigma, apart), places = draw._prepared, draw._places
        assert len(set(places)) == 3
        assert np.isfinite(board.prior.log_of(places)), "a model that the search may find"
        families[board.evidence.candidate(int(board.use[places[0]])).family] += 1
    candidates = [board.evidence.candidate(int(column)) for column in board.use]
    size = {c.label: s for c, s in zip(candidates, board.size, strict=True)}
    left = {c.label: apart[int(column)] for c, column in zip(candidates, board.use, strict=True)}
    assert min(left.values()) < 0.05, "the prior of a coefficient alone tells some"
    one_sigma = {c.label: sigma[int(column)] for c, column in zip(candidates, board.use, strict=True)}
    hidden = [one for one in drawn if one is not None]
    assert 0.6 < len(hidden) / len(drawn) < 0.99
    assert left_out not in {one.family for one in hidden}
    for one in hidden:
        parse_effects([one.text])
        label = one.text.rpartition("=")[0]
        of_size.append(one.value / size[label])
        assert one.sigmas == pytest.approx(abs(one.value) / one_sigma[label])
        assert left[label] >= 0.05
    # Families have the shares of the prior, that which is left out as well.
    share = Counter()
    for candidate, own in zip(candidates, np.exp(board.prior.log_share), strict=True):
        share[candidate.family] += own
    assert families[left_out] > 0
    for family, expected in share.items():
        assert abs(families[family] - worlds * expected) < 4.5 * np.sqrt(worlds * expected) + 1.0, family
    # Of three widths, the usual one with .74: a normal size of it is below 1 in .68 of them. Signs are as often either.
    within = 0.74 * 0.683 + 0.24 * 0.159 + 0.02 * 0.016
    count = len(of_size)
    assert abs(np.mean(np.abs(of_size) < 1.0) - within) < 4.0 * np.sqrt(within * (1.0 - within) / count)
    both = [v for v, one in zip(of_size, hidden, strict=True) if not one_sided(one.name)]
    assert abs(np.mean(np.array(both) > 0.0) - 0.5) < 0.1


def test_sigmas_count_the_noise(fit):
    walk = (NoiseTerm("gyro", "random_walk", size=np.deg2rad(0.1) / 3600.0 / 60.0),)
    still, noisy = (BelievedEffects(np.random.default_rng(4), noise) for noise in ((), walk))
    pairs = [(one, other) for one, other in ((still(fit), noisy(fit)) for _ in range(12)) if one is not None]
    assert len(pairs) > 3
    assert all(one.text == other.text for one, other in pairs)
    assert all(other.sigmas <= one.sigmas * (1.0 + 1e-9) for one, other in pairs)
    assert min(other.sigmas / one.sigmas for one, other in pairs) < 0.5
