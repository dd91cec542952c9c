"""Worlds as the prior has them: number and size of effects and of noise, and that the simulator makes them."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

from sdimu_calibration.core.estimation.solve import solve
from sdimu_calibration.core.noise_term import TRIADS
from sdimu_calibration.core.posterior.noise_models import ODDS, usual_sizes
from sdimu_calibration.core.specification import Site
from sdimu_calibration.storage.files.config import load_imu, load_model
from sdimu_sim.core.coloured import KINDS, parse_noise
from sdimu_sim.core.hidden import parse_effects
from sdimu_study.believed import BelievedEffects, believed_count, believed_noise
from sdimu_study.worlds import simulated_test

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
    drawn = [[parse_noise(text) for text in believed_noise(imu, rng)] for _ in range(WORLDS)]
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


@pytest.fixture(scope="module")
def fit():
    test, _ = simulated_test("dtg", load_imu("dtg"), "kim18_signed", Site(0.6, 0.0), 5, ())
    return solve(test, load_model("baseline"))


def test_effects_are_drawn_of_the_prior_and_the_simulator_reads_them(fit):
    rng = np.random.default_rng(3)
    of_size, worlds = [], 150
    draw = BelievedEffects(rng, (), {"gyro_lost_data"})
    for _ in range(worlds):
        draw._drawn.clear()
        drawn = [draw(fit) for _ in range(3)]
        board = draw._board
        sizes = {c.label: s for c, s in zip(map(board.evidence.candidate, board.use), board.size, strict=True)}
        assert len(set(draw._drawn)) == 3
        assert np.isfinite(board.prior.log_of(draw._drawn)), "a model that the search may find"
        assert "gyro_lost_data" not in {one.family for one in drawn}
        for one in drawn:
            parse_effects([one.text])
            label = one.text.rpartition("=")[0]
            of_size.append(abs(one.value) / sizes[label])
            assert one.sigmas > 0.0
    # Of three widths, the usual one with .74: a normal size of it is below 1 in .68 of them.
    within = 0.74 * 0.683 + 0.24 * 0.159 + 0.02 * 0.016
    count = len(of_size)
    assert abs(np.mean(np.array(of_size) < 1.0) - within) < 4.0 * np.sqrt(within * (1.0 - within) / count)
