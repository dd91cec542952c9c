"""The study of noise: an effect is sized in the noise that hides it, and scored apart from what is not there."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sdimu_calibration.core.evidence.noise_root import root_of
from sdimu_calibration.core.noise_term import NoiseTerm
from sdimu_calibration.core.specification import Site
from sdimu_calibration.storage.files.config import load_imu, load_model
from sdimu_study.noise import STUDY, NoiseCase, page, seen_noise
from sdimu_study.worlds import OneTest, diagnosed, drawn_effect, simulated_test


def test_an_effect_of_ten_sigma_is_larger_where_noise_wanders(fit):
    walk = NoiseTerm("gyro", "random_walk", size=np.deg2rad(0.1) / 3600.0 / 60.0)
    none = NoiseTerm("gyro", "random_walk", size=1e-9 * walk.size)
    ratios = {}
    for family in ("gyro_scale_asymmetry", "accel_quadratic"):
        white, noisy, still = (
            drawn_effect(np.random.default_rng(7), fit, (10.0, 10.0), (family,), noise=noise)
            for noise in ((), (walk,), (none,))
        )
        assert white.name == noisy.name
        assert white.sigmas == noisy.sigmas == pytest.approx(10.0)
        assert still.value == pytest.approx(white.value, rel=1e-6)
        ratios[family] = noisy.value / white.value
    # The walk is the gyros': accelerometers feel it through the attitude alone.
    assert ratios["gyro_scale_asymmetry"] > ratios["accel_quadratic"] > 1.0


def test_the_page_counts_what_was_hidden_apart_from_what_is_not_there():
    term = {"triad": "gyro", "kind": "flicker", "size": 1.0, "low": 0.5, "high": 2.0, "alike": [], "true": 1.5}
    rows = [
        {"terms": [term], "hidden": "a=1", "named": True, "effects": [], "z2": 27.0, "count": 27},
        {"terms": [], "hidden": "b=1", "named": False, "effects": ["gyro_delay_x"], "z2": 27.0, "count": 27},
        {"error": "refused"},
    ]
    last = page({("dtg", "flicker"): rows}, 1).splitlines()[-1]
    assert last == "| dtg | flicker | 1 of 4 | 1 of 1 | 1 of 1 | 1 of 2 | 1 of 2 | 1.00 | 1 |"


def test_noise_is_seen_where_it_gains_likelihood_beside_the_other_terms():
    imu = load_imu("dtg")
    test, sensor = simulated_test("dtg", imu, "kim18_10_min", Site(0.6, 0.0), 5, ())
    board = diagnosed(OneTest(test, load_model("baseline"), sensor)).found.posterior.board.as_stated
    strong = NoiseTerm("gyro", "flicker", size=np.deg2rad(1.0) / 3600.0)
    slower = NoiseTerm("gyro", "markov", 150.0, 0.05 * strong.size)
    assert seen_noise(board, []) == []
    assert seen_noise(board, [slower]) == [slower]
    # What a strong term of the same triad covers is not seen, in whatever order they stand.
    assert seen_noise(board, [strong, slower]) == seen_noise(board, [slower, strong]) == [strong]
    # One of two is seen where they gain enough together.
    least = min(
        (replace(strong, size=strong.size * 1.05**-k) for k in range(200)),
        key=lambda term: (not seen_noise(board, [term]), term.size),
    )
    assert len(seen_noise(board, [least, replace(slower, size=least.size)])) == 1
    # From a gain of .5 on, as the search asks for: the gain is a monotonic function of the size.
    J, cut = board.joint.on_wander(*board.parameters(())).J, board.wander.cut
    shown = np.linalg.eigvalsh(root_of([least], cut).T @ J @ root_of([least], cut)).clip(0.0)
    assert 0.5 <= 0.5 * np.sum(shown - np.log(1.0 + shown)) < 0.6


@pytest.mark.slow
def test_an_effect_in_noise_is_named():
    rows = [STUDY.of(NoiseCase("dtg", "stop", 20.0))(seed) for seed in (31, 32, 33)]
    assert sum(row["named"] for row in rows) >= 2
