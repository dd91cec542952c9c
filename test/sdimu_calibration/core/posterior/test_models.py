"""Scores in closed form against determinants written out; the climb and the window against all models there are."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from bare_prior import prior
from scipy.stats import multivariate_normal

from sdimu_calibration.core.posterior.models import Data
from sdimu_calibration.core.posterior.prior import KIN, MEAN_NUMBER, MOST_DRIFTS, WIDTH_SHARES, WIDTHS, Prior, twins
from sdimu_calibration.core.posterior.search import WINDOW, best_from, window

ROWS = 40


def drawn(q: int, rng: np.random.Generator, alike: float = 0.9) -> np.ndarray:
    """Signatures of which neighbours resemble each other, in units of the prior sizes; shape (ROWS, q)."""
    W = rng.standard_normal((ROWS, q))
    for k in range(1, q):
        W[:, k] = alike * W[:, k - 1] + np.sqrt(1.0 - alike**2) * W[:, k]
    return W


def data_of(W: np.ndarray, e: np.ndarray, known: Prior) -> Data:
    return Data(W.T @ W, W.T @ e, known)


def log_posterior(W: np.ndarray, e: np.ndarray, known: Prior, members: tuple[tuple[int, int], ...]) -> float:
    """Log posterior over that of no effect, from the density of the measurements themselves."""
    covariance = np.eye(len(e))
    for k, width in members:
        covariance += WIDTHS[width] ** 2 * np.outer(W[:, k], W[:, k])
    nothing = np.zeros(len(e))
    density = multivariate_normal.logpdf(e, nothing, covariance) - multivariate_normal.logpdf(
        e, nothing, np.eye(len(e))
    )
    columns = [k for k, _ in members]
    share = sum(np.log(WIDTH_SHARES[width]) for _, width in members)
    count = len(columns)
    # Equations that no physics names do not make others likelier.
    named = np.count_nonzero(~known.own[columns])
    number = np.sum(np.log(np.arange(1, named + 1))) - count * np.log1p(1.0 / MEAN_NUMBER)
    kin = sum(KIN for k in range(count) if known.cause[columns[k]] in known.cause[columns[:k]])
    return float(density + share + known.log_share[columns].sum() + number + kin)


EQUATIONS = (np.zeros(6, dtype=bool), np.array([False, False, False, True, True, False]))
"""None of the candidates is an equation; two are."""


@pytest.mark.parametrize("own", EQUATIONS, ids=("catalogue", "equations"))
@pytest.mark.parametrize(
    "members", [(), ((1, 0),), ((0, 1), (3, 0)), ((0, 0), (1, 2), (4, 1)), ((3, 0), (4, 1), (5, 0))]
)
def test_a_score_is_the_log_posterior(members, own):
    rng, known = np.random.default_rng(1), prior(6, own=own)
    W = drawn(6, rng)
    e = W[:, 3] * 2.0 + rng.standard_normal(ROWS)
    assert data_of(W, e, known).at(members).score == pytest.approx(log_posterior(W, e, known, members), abs=1e-9)


@pytest.mark.parametrize("own", EQUATIONS, ids=("catalogue", "equations"))
def test_every_move_has_the_score_of_the_model_that_it_leads_to(own):
    rng, known = np.random.default_rng(2), prior(6, own=own)
    W = drawn(6, rng)
    data = data_of(W, W[:, 1] - 2.0 * W[:, 4] + rng.standard_normal(ROWS), known)
    here = data.at(((1, 0), (4, 1)))
    moves = list(here.neighbours(-np.inf))
    # Two are dropped; four of three widths are added, and in each of two places there are those and its own widths.
    assert len(moves) == 2 + 4 * 3 + 2 * (4 + 1) * 3
    for score, members in moves:
        assert score == pytest.approx(data.at(members).score, abs=1e-9)
    score, members = here.paired()
    assert score == pytest.approx(data.at(members).score, abs=1e-9)
    score, members = here.merged()
    assert score == pytest.approx(data.at(members).score, abs=1e-9)


def test_the_best_pair_is_that_of_all_pairs():
    rng, known = np.random.default_rng(3), prior(7)
    W = drawn(7, rng)
    data = data_of(W, 3.0 * (W[:, 2] - W[:, 3]) + rng.standard_normal(ROWS), known)
    best = max(
        data.at(((i, width), (j, width))).score
        for i, j in itertools.combinations(range(7), 2)
        for width in range(len(WIDTHS))
    )
    assert data.at(()).paired()[0] == pytest.approx(best, abs=1e-9)


def test_variants_of_a_parameter_exclude_each_other_unless_they_happen_at_one_time():
    rng = np.random.default_rng(4)
    W = drawn(4, rng, alike=0.0)
    e = 5.0 * (W[:, 0] + W[:, 1]) + rng.standard_normal(ROWS)
    same = np.array([0, 0, 1, 2])
    _, members = best_from(data_of(W, e, prior(4, parameter=same)), ())
    assert len({k for k, _ in members} & {0, 1}) == 1
    _, members = best_from(data_of(W, e, prior(4, parameter=same, repeats=np.ones(4, dtype=bool))), ())
    assert {0, 1} <= {k for k, _ in members}


def test_a_bias_has_four_drifts_at_most():
    rng = np.random.default_rng(7)
    W = drawn(7, rng, alike=0.0)
    data = data_of(W, 9.0 * W.sum(axis=1) + rng.standard_normal(ROWS), prior(7, drift=np.array([3] * 6 + [-1])))
    members = best_from(data, (), of_two=False)[1]
    assert len(members) == MOST_DRIFTS + 1
    assert 6 in {k for k, _ in members}


def test_a_pair_beside_three_drifts_of_a_bias_is_one_that_a_model_may_hold():
    """Each of two more drifts may come alone, both not: a climb that took them went to and fro without an end."""
    rng, known = np.random.default_rng(12), prior(7, drift=np.array([2, 2, 2, 2, 2, 3, -1]))
    W = drawn(7, rng, alike=0.3)
    e = 20.0 * W[:, :5].sum(axis=1) + 3.0 * W[:, 5] + 3.0 * W[:, 6] + rng.standard_normal(ROWS)
    data = data_of(W, e, known)
    here = data.at(tuple((k, 1) for k in range(MOST_DRIFTS - 1)))
    score, members = here.paired()
    assert score == pytest.approx(data.at(members).score, abs=1e-9)
    assert len([k for k, _ in members if known.drift[k] == 2]) == MOST_DRIFTS
    score, members = best_from(data, ())
    assert np.isfinite(score)
    assert score == pytest.approx(data.at(members).score, abs=1e-9)


def test_what_cannot_be_negative_is_not():
    rng = np.random.default_rng(5)
    W = drawn(3, rng, alike=0.0)
    e = -5.0 * W[:, 0] + rng.standard_normal(ROWS)
    assert best_from(data_of(W, e, prior(3)), ())[1]
    assert not best_from(data_of(W, e, prior(3, positive=np.ones(3, dtype=bool))), ())[1]


@pytest.mark.parametrize("seed", range(5))
def test_climb_and_window_find_what_a_look_at_all_models_finds(seed):
    """All 4^6 models of six candidates of three widths."""
    rng, known = np.random.default_rng(seed), prior(6)
    W = drawn(6, rng, alike=0.8)
    e = W @ (rng.standard_normal(6) * np.array([1.5, 0.0, 0.0, 2.0, 0.0, 0.0])) + rng.standard_normal(ROWS)
    data = data_of(W, e, known)
    every = {}
    for widths in itertools.product((None, 0, 1, 2), repeat=6):
        members = tuple((k, w) for k, w in enumerate(widths) if w is not None)
        every[members] = data.at(members).score
    score, best = best_from(data, ())
    assert score == pytest.approx(max(every.values()), abs=1e-9)
    found = {members: s for (_, members), s in window([data], [0.0], [best]).items()}
    near = {members: s for members, s in every.items() if s > score - WINDOW}
    weight = np.exp(np.array(list(near.values())) - score)
    seen = np.exp(np.array([s for m, s in near.items() if m in found]) - score)
    assert seen.sum() > 0.999 * weight.sum()
    assert all(found[m] == pytest.approx(s, abs=1e-9) for m, s in near.items() if m in found)


def test_probabilities_come_true_where_the_world_is_as_the_prior_says():
    """Of 400 worlds drawn from the prior, the shares that are true are those told, a fifth of probability at a time."""
    rng, q = np.random.default_rng(6), 8
    known = prior(q, cause=np.arange(q))
    told, true = [], []
    for _ in range(400):
        W = drawn(q, rng, alike=0.7)
        rate = rng.exponential(MEAN_NUMBER)
        while True:
            # The prior has each candidate once at most.
            members = rng.choice(q, rng.poisson(rate), p=np.exp(known.log_share))
            if len(set(members)) == len(members):
                break
        size = rng.choice(WIDTHS, q, p=WIDTH_SHARES) * rng.standard_normal(q)
        data = data_of(W, W[:, members] @ size[members] + rng.standard_normal(ROWS), known)
        found = window([data], [0.0], [best_from(data, ())[1]])
        weight = np.exp(np.array(list(found.values())) - max(found.values()))
        for k in range(q):
            told.append(
                sum(w for w, (_, m) in zip(weight, found, strict=True) if any(j == k for j, _ in m)) / weight.sum()
            )
            true.append(k in members)
    p, right = np.array(told), np.array(true)
    for low in np.arange(0.0, 1.0, 0.2):
        inside = (p >= low) & (p <= low + 0.2)
        assert inside.sum() > 30
        spread = np.sqrt(np.sum(p[inside] * (1.0 - p[inside]))) / inside.sum()
        assert abs(right[inside].mean() - p[inside].mean()) < 3.0 * spread + 0.02


def test_what_no_data_tell_apart_is_in_a_model_once():
    rng = np.random.default_rng(2)
    W = drawn(6, rng)
    W[:, 4] = -3.0 * W[:, 1]
    number = twins(W.T @ W)
    assert number[4] == number[1]
    assert len(set(number.tolist())) == 5
    known = prior(6, twin=number)
    data = data_of(W, 6.0 * W[:, 1] / np.linalg.norm(W[:, 1]) + rng.standard_normal(ROWS), known)
    found = {m for _, m in window([data], [0.0], [best_from(data, ())[1]])}
    held = [{k for k, _ in m} for m in found]
    assert any(1 in have for have in held)
    assert any(4 in have for have in held)
    assert not any({1, 4} <= have for have in held)
    apart, _ = known.apart((), np.arange(6))
    assert (apart[1] == apart[4]).any()


def test_a_size_that_another_effect_turns_negative_makes_no_model():
    """True sizes are -1 and 3 of two effects that look alike, and the first cannot be negative."""
    J = 100.0 * np.array([[1.0, 0.9], [0.9, 1.0]])
    data = Data(J, J @ np.array([-1.0, 3.0]), prior(2, positive=np.array([True, False]), cause=np.arange(2)))
    found = window([data], [0.0], [((0, 0),)])
    assert {number for number, _ in max(found, key=found.get)[1]} == {1}
    assert all(len(members) < 2 for _, members in found)
    assert data.at(((0, 0), (1, 0))).score == -np.inf


def test_a_member_that_cannot_be_negative_stands_beside_what_leaves_it_positive():
    rng, known = np.random.default_rng(21), prior(6, positive=np.array([True, True, False, False, False, False]))
    W = drawn(6, rng)
    data = data_of(W, 0.2 * W[:, 0] + 3.0 * W[:, 2] + rng.standard_normal(ROWS), known)
    # Alone it takes up what the third one is.
    here = data.at(((0, 0),))
    sizes = here.r[:, None] / (here.c[:, None] + np.array(WIDTHS) ** -2.0)
    stands, seen = here.stands(sizes), set()
    for k in range(2, 6):
        for width in range(len(WIDTHS)):
            is_one = np.isfinite(data.at((*here.members, (k, width))).score)
            assert stands[k, width] == is_one
            seen.add(is_one)
    assert seen == {True, False}


def test_two_that_come_at_once_are_no_equations():
    """Two of them explain any curve: each may come alone, and never as one of a pair."""
    rng = np.random.default_rng(13)
    own = np.array([False, False, False, True, True, False])
    known, W = prior(6, own=own), drawn(6, rng)
    data = data_of(W, 9.0 * (W[:, 3] - W[:, 4]) + rng.standard_normal(ROWS), known)
    best = max(
        data.at(((i, width), (j, width))).score
        for i, j in itertools.combinations(np.flatnonzero(~own).tolist(), 2)
        for width in range(len(WIDTHS))
    )
    score, members = data.at(()).paired()
    assert score == pytest.approx(best, abs=1e-9)
    assert not own[[k for k, _ in members]].any()


def test_two_are_not_replaced_where_what_stays_would_turn_negative():
    rng = np.random.default_rng(14)
    W = drawn(5, rng)
    known = prior(5, positive=np.array([True, False, False, False, False]))
    data = data_of(W, 2.0 * W[:, 0] - 6.0 * W[:, 1] + 3.0 * W[:, 3] + 0.1 * rng.standard_normal(ROWS), known)
    here = data.at(((0, 1), (1, 1), (3, 1)))
    assert np.isfinite(here.score)
    assert data.at(((0, 1),)).score == -np.inf
    assert [others for others, _ in here.mergers()] == [((3, 1),), ((1, 1),)]
