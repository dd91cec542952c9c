"""The size that is stated as told in 80 % of tests is the size at which the posterior tells it in so many."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sdimu_calibration.core.diagnosis.found import reach
from sdimu_calibration.core.diagnosis.search import told_effects
from sdimu_calibration.core.noise_term import RANDOM_WALK, NoiseTerm
from sdimu_calibration.core.posterior import rival_noise
from sdimu_calibration.core.posterior.detectable import POWER, POWER_SIGMAS, told_from
from sdimu_calibration.core.posterior.models import gains
from sdimu_calibration.core.posterior.noise_models import NoiseModel, usual_sizes
from sdimu_calibration.core.posterior.posterior import PROBABLE, posterior
from sdimu_calibration.core.probability import normal_tail


@pytest.fixture(scope="module")
def board(diagnosis):
    return diagnosis.found.posterior.board


@pytest.fixture(scope="module")
def plain(board):
    """Scores without noise to take effects for: what one effect beside nothing needs."""
    lone = type(board)(board.evidence, board.allowed, board.finer, None)
    return lone, told_from(lone)


def test_the_margin_is_that_of_eighty_per_cent():
    assert normal_tail(-POWER_SIGMAS) == pytest.approx(POWER, abs=1e-4)


def test_of_draws_of_one_effect_with_its_prior_sizes_four_in_five_are_probable(plain):
    """Draws of the pull, weighed by the closed form of models, against the root of another formula."""
    board, scores = plain
    data = board.data(NoiseModel())[1]
    rng = np.random.default_rng(11)
    odds = data.prior.log_more(())
    families = [board.evidence.candidate(c).family for c in board.use.tolist()]
    alone = [k for k, family in enumerate(families) if families.count(family) == 1 or family == "accel_quadratic"]
    draws, share = 20_000, []
    for k in alone[:20]:
        c = data.J[k, k]
        if not scores.needed[k] < 50.0:
            continue
        r = scores.needed[k] * np.sqrt(c) + np.sqrt(c) * rng.standard_normal(draws)
        weight = np.exp(np.logaddexp.reduce(gains(np.full(draws, c), r, np.zeros(draws, bool)), axis=1) + odds[k])
        share.append(np.mean(weight / (1.0 + weight) > PROBABLE))
    assert len(share) > 5
    # The scatter of a share of 20,000 draws is 0.003.
    np.testing.assert_allclose(share, POWER, atol=0.012)


@pytest.mark.parametrize("name", ["gyro_bias_ramp_x", "accel_quadratic_y", "accel_cross_coupling_zy"])
def test_what_a_noise_takes_of_an_effect_is_what_the_information_in_that_noise_lacks(board, name):
    labels = [board.evidence.candidate(c).label for c in board.use.tolist()]
    k = labels.index(name)
    cut, usual = board.wander.cut, usual_sizes(board.evidence.imu)
    A, B, J = rival_noise._blocks(board.joint, board.use, ())
    term = NoiseTerm("accel" if name.startswith("accel") else "gyro", RANDOM_WALK)
    _, taken = rival_noise._of_kind(A, B, term, cut, usual)
    root = cut.mode(term.kind, term.tau)
    first = 3 * (term.triad == "accel")
    at = np.concatenate([np.arange(len(root)) * 6 + first + axis for axis in range(3)])
    every = np.kron(np.eye(3), root)
    largest = np.linalg.eigvalsh(every.T @ A[np.ix_(at, at)] @ every).max()
    stated = board.as_stated
    white = stated.data(NoiseModel())[1].J[k, k]
    for place in (8, 16, 24):
        size = float(np.sqrt(rival_noise._VARIANCES[place] / largest))
        left = stated.data(NoiseModel((replace(term, size=size),)))[1].J[k, k]
        assert taken[place, k] / J[k] == pytest.approx(1.0 - left / white, abs=1e-6)


def test_a_drift_that_a_random_walk_imitates_must_be_larger_than_without_it(diagnosis, board, plain):
    needed = {}
    for key, scores in (("with", told_from(board)), ("without", plain[1])):
        names = [board.evidence.candidate(c).label for c in scores.column.tolist()]
        needed[key] = dict(zip(names, scores.needed.tolist(), strict=True))
    assert needed["with"]["gyro_bias_ramp_y"] > needed["without"]["gyro_bias_ramp_y"] + 1.0
    quick = "accel_quadratic_y"
    assert needed["with"][quick] == pytest.approx(needed["without"][quick], abs=0.3)
    told = {one.label: one for one in reach(diagnosis)}
    assert told["gyro_bias_ramp_y"].smallest == pytest.approx(
        needed["with"]["gyro_bias_ramp_y"] * told["gyro_bias_ramp_y"].sigma, rel=1e-6
    )


def test_the_search_tells_about_four_in_five_effects_of_the_stated_size(board):
    """Three effects, fifteen draws of noise each: of 45 with 80 %, fewer than 27 or 45 have a probability of 1e-3."""
    scores = told_from(board)
    evidence, rng, named = board.evidence, np.random.default_rng(12), 0
    sizes = {evidence.candidate(c).label: (c, s) for c, s in scores.size.items()}
    for name in ("gyro_bias_ramp_y", "accel_quadratic_y", "accel_cross_coupling_zy"):
        column, size = sizes[name]
        coefficient = evidence.candidate(column).coefficient
        for _ in range(15):
            e = rng.standard_normal(len(evidence.e)) + evidence.W[:, column] * size * rng.choice((-1.0, 1.0))
            found = posterior(replace(evidence, e=e), board.allowed, board.wander)
            told = told_effects(found)
            every = {x for c in told for x in (c, *found.alike(c))}
            named += coefficient in {found.board.evidence.candidate(c).coefficient for c in every}
    assert 27 <= named <= 44
