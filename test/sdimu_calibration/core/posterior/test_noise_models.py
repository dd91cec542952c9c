"""Probabilities of kinds of noise come true where each triad has its own, whatever the other one has."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations, product

import numpy as np
import pytest
from scipy.stats import norm

from sdimu_calibration.core.effects.effect import Timetable
from sdimu_calibration.core.evidence.learned_noise import InModes, NoiseInformation
from sdimu_calibration.core.evidence.noise_kernels import kernel, stretches
from sdimu_calibration.core.noise_term import FLICKER, MARKOV, RANDOM_WALK, SHIFT, STOP, TRIADS, TURN, NoiseTerm
from sdimu_calibration.core.posterior.noise_models import (
    ODDS,
    SENSORS,
    SHARE,
    NoiseModel,
    every_kind,
    log_odds,
    usual_sizes,
)
from sdimu_calibration.core.posterior.noise_search import _Search, explored, instead_of
from sdimu_calibration.storage.files.config import load_imu

TRIED = tuple(NoiseTerm(triad, kind) for triad in TRIADS for kind in (RANDOM_WALK, FLICKER, STOP, TURN, SHIFT))
DWELL_S, TURN_S, STOPS = 60.0, 12.0, 12


@pytest.fixture(scope="module")
def cut():
    starts = [k * (DWELL_S + TURN_S) for k in range(STOPS)]
    stops = tuple((k, t, t + DWELL_S) for k, t in enumerate(starts))
    turns = tuple((k, t + DWELL_S, t + DWELL_S + TURN_S) for k, t in enumerate(starts[:-1]))
    return stretches(Timetable(stops=stops, turns=turns, duration=starts[-1] + DWELL_S))


@pytest.fixture(scope="module")
def usual():
    return usual_sizes(load_imu("dtg"))


def drawn(rng, cut, usual):
    """Draw a kind of noise, or none, and its size for each triad by the prior; measure the mean of each stretch."""
    kinds = [kind for kind in ODDS if any(t.kind == kind for t in TRIED)]
    odds = np.array([1.0, *(ODDS[kind] for kind in kinds)])
    J, error, there = np.zeros(6 * len(cut)), np.zeros((len(cut), 6)), set()
    for place, triad in enumerate(TRIADS):
        axes = slice(3 * place, 3 * place + 3)
        level = usual.centre[triad, FLICKER] / SHARE[FLICKER]
        J.reshape(-1, 6)[:, axes] = 1.0 / (0.5 * level) ** 2
        choice = int(rng.choice(len(odds), p=odds / odds.sum()))
        if choice:
            kind = kinds[choice - 1]
            there.add((triad, kind))
            size = usual.centre[triad, kind] * np.exp(usual.spread[triad, kind] * rng.standard_normal())
            root = np.linalg.cholesky(kernel(kind, 0.0, cut) + 1e-12 * np.eye(len(cut)))
            error[:, axes] = size * root @ rng.standard_normal((len(cut), 3))
    d = J * error.ravel() + np.sqrt(J) * rng.standard_normal(len(J))
    return NoiseInformation(np.diag(J), d), there


def told(information, cut, usual):
    """Probability of each kind of noise in each triad, and that both triads have what they have."""
    found = explored(information, cut, usual, TRIED)
    weight = np.exp(np.array([score for score, _ in found]) - found[0][0])
    out = {(t.triad, t.kind): 0.0 for t in TRIED}
    for w, (_, noise) in zip(weight / weight.sum(), found, strict=True):
        for triad, kind, *_ in noise.kinds:
            out[triad, kind] += w
    return out


def test_probabilities_of_kinds_come_true(cut, usual):
    # Where a triad has noise that is seen: a size that is too small for that is told as none.
    rng = np.random.default_rng(20261124)
    p, right = [], []
    for _ in range(40):
        information, there = drawn(rng, cut, usual)
        found = told(information, cut, usual)
        for triad in TRIADS:
            if sum(found[triad, t.kind] for t in TRIED if t.triad == triad) > 0.9:
                p += [found[triad, t.kind] for t in TRIED if t.triad == triad]
                right += [(triad, t.kind) in there for t in TRIED if t.triad == triad]
    assert len(p) > 100
    p, right = np.minimum(p, 1.0), np.array(right)
    for low, high in ((0.0, 0.05), (0.05, 0.3), (0.3, 0.7), (0.7, 0.95), (0.95, 1.01)):
        inside = (p >= low) & (p < high)
        spread = np.sqrt(np.sum(p[inside] * (1.0 - p[inside])))
        assert abs(p[inside].sum() - right[inside].sum()) < 3.0 * spread + 0.5, (low, p[inside].mean())


def test_what_is_told_of_a_triad_does_not_hang_on_the_noise_of_the_other(cut, usual):
    # Each of the two alone leaves several kinds open; together they leave as many open in each.
    rng = np.random.default_rng(7)
    for _ in range(5):
        information, _ = drawn(rng, cut, usual)
        both = told(information, cut, usual)
        for place, triad in enumerate(TRIADS):
            d = information.d.reshape(-1, 6).copy()
            d[:, 3 - 3 * place : 6 - 3 * place] = 0.0
            alone = told(NoiseInformation(information.J, d.ravel()), cut, usual)
            for term in TRIED:
                if term.triad == triad:
                    assert both[triad, term.kind] == pytest.approx(alone[triad, term.kind], abs=0.04)


def seen_through_gyros(rng, cut, usual, strong=FLICKER):
    """Shifts of the accelerometers beside noise of the gyros thirty times white noise, which tilts what they see."""
    n = len(cut)
    level = [usual.centre[triad, FLICKER] for triad in TRIADS]
    sizes = [30.0 * level[0], 3.0 * usual.centre["accel", SHIFT]]
    roots = [np.linalg.cholesky(kernel(kind, 0.0, cut) + 1e-12 * np.eye(n)) for kind in (strong, SHIFT)]
    tilts = 0.3 * level[1] / level[0] * rng.choice([-1.0, 1.0], (n, 1)) * np.tril(np.ones((n, n))) / n
    H = np.block([[np.eye(n) / level[0], np.zeros((n, n))], [tilts / level[1], np.eye(n) / level[1]]]) / 0.5
    J, d = np.zeros((n, 2, 3, n, 2, 3)), np.zeros((n, 2, 3))
    for axis in range(3):
        error = [size * root @ rng.standard_normal(n) for size, root in zip(sizes, roots, strict=True)]
        y = H @ np.concatenate(error) + rng.standard_normal(2 * n)
        d[:, :, axis] = (H.T @ y).reshape(2, n).T
        J[:, :, axis, :, :, axis] = (H.T @ H).reshape(2, n, 2, n).transpose(1, 0, 3, 2)
    return NoiseInformation(J.reshape(6 * n, 6 * n), d.ravel())


@pytest.mark.parametrize("seed", range(4))
def test_noise_of_one_triad_is_found_beside_strong_noise_of_the_other(cut, usual, seed):
    """By itself the other kinds explain hundreds of what the strong noise does: beside it they do not."""
    information = seen_through_gyros(np.random.default_rng(seed), cut, usual)
    found = told(information, cut, usual)
    assert found["gyro", FLICKER] > 0.9
    assert found["accel", SHIFT] > 0.5


def test_kinds_in_the_place_of_strong_noise_are_sized_beside_the_noise_that_is_there(cut, usual):
    """A random walk and Markov noise as long as the test look the same, however strong: both are told as open."""
    open_ = 0
    for seed in range(4):
        information = seen_through_gyros(np.random.default_rng(seed), cut, usual, RANDOM_WALK)
        found = explored(information, cut, usual)
        likeliest = {triad: [t for t in found[0][1].terms if t.triad == triad] for triad in TRIADS}
        assert len(likeliest["gyro"]) == 1
        assert likeliest["accel"]
        told = {t.identity for _, noise in found for t in noise.terms}
        given = information.of_triad("gyro", likeliest["accel"], cut)
        score = {}
        for term in (t for t in every_kind(cut) if t.triad == "gyro"):
            size, gain = InModes.of(given, cut, term.kind, term.tau).sizes_on_grid(term.axes)
            share = np.exp(gain + usual.log_density(term, size) - gain.max())
            log_mass = np.log(share.sum() * np.log(size[1] / size[0]))
            score[term.identity] = gain.max() + log_mass + log_odds(term)
        near = {kind for kind, one in score.items() if one > max(score.values()) - 4.0}
        open_ += len(near) - 1
        assert near <= told
    assert open_ > 0


def test_the_time_constants_of_gauss_markov_noise_share_its_odds(cut):
    markov = [t for t in every_kind(cut) if t.triad == "gyro" and t.kind == MARKOV]
    share = np.array([np.exp(log_odds(term)) for term in markov]) / ODDS[MARKOV]
    # Of a log-normal prior what lies between the tried ones; the rest is faster than a stretch or slower than the test.
    tau = np.array([term.tau for term in markov])
    density = norm(np.log(300.0), 1.2)
    within = density.cdf(np.log(tau[-1] * 2**0.5)) - density.cdf(np.log(tau[0] * 2**-0.5))
    assert share.sum() == pytest.approx(within, abs=0.02)
    assert abs(np.log(tau[np.argmax(share)] / 300.0)) < np.log(1.5)
    assert np.diff(np.log(tau)) == pytest.approx(np.log(2.0), rel=0.01)
    assert tau[-1] == pytest.approx(cut.end[-1] / 3.0, rel=0.01)


def two_in_each(rng, cut, usual):
    """Two terms in each triad, of one to twenty times their usual sizes, each triad by itself."""
    n = len(cut)
    J, error = np.zeros((n, 6)), np.zeros((n, 6))
    for place, triad in enumerate(TRIADS):
        axes = slice(3 * place, 3 * place + 3)
        J[:, axes] = (2.0 * SHARE[FLICKER] / usual.centre[triad, FLICKER]) ** 2
        for kind in rng.choice([RANDOM_WALK, FLICKER, STOP, TURN, SHIFT], 2, replace=False):
            size = usual.centre[triad, kind] * 20.0 ** rng.random()
            root = np.linalg.cholesky(kernel(str(kind), 0.0, cut) + 1e-12 * np.eye(n))
            error[:, axes] += size * root @ rng.standard_normal((n, 3))
    d = J * error + np.sqrt(J) * rng.standard_normal(J.shape)
    return NoiseInformation(np.diag(J.ravel()), d.ravel())


def test_no_pair_of_kinds_in_a_triad_is_far_better_than_what_is_found(cut, usual):
    """Held against all pairs, each at its best sizes beside the likeliest noise of the other triad.

    One term stands for two that are both missing: beside it neither is seen.
    """
    behind, passed_over, near = [], 0, 0
    for seed in range(30):
        information = two_in_each(np.random.default_rng(seed), cut, usual)
        found = explored(information, cut, usual, TRIED)
        (score, likeliest), told = found[0], {noise.kinds for _, noise in found}
        search = _Search(information, cut, usual, TRIED)
        for triad, kinds in product(TRIADS, combinations((RANDOM_WALK, FLICKER, STOP, TURN, SHIFT), 2)):
            terms = [NoiseTerm(triad, kind, size=usual.centre[triad, kind]) for kind in kinds]
            beside = [k for k, t in enumerate(likeliest.terms) if t.triad != triad]
            every = (*(likeliest.terms[k] for k in beside), *terms)
            shares = (*(likeliest.shares[k] for k in beside), 0.0, 0.0)
            pair = search.settled(NoiseModel(every, shares), (triad,))
            behind.append(score - pair.score)
            near += pair.score > score - 3.0
            passed_over += pair.score > score - 3.0 and pair.noise.kinds not in told
    assert near > 100
    # Odds of 20, and one pair in ten: what is passed over moves no probability from open to certain.
    assert min(behind) > -3.0
    assert passed_over < 0.1 * near


def test_the_likeliest_noise_without_terms_like_effects_is_found_where_all_others_have_some(cut, usual):
    """Errors of stops and turns in both triads, over flicker: flicker in both triads at once was never tried."""
    rng, n = np.random.default_rng(0), len(cut)
    J, error = np.zeros((n, 6)), np.zeros((n, 6))
    for place, triad in enumerate(TRIADS):
        axes, size = slice(3 * place, 3 * place + 3), usual.centre[triad, FLICKER]
        J[:, axes] = (SHARE[FLICKER] / size) ** 2
        for kind, share in ((FLICKER, 0.7), (STOP, 4.0), (TURN, 30.0)):
            root = np.linalg.cholesky(kernel(kind, 0.0, cut) + 1e-12 * np.eye(n))
            error[:, axes] += share * size * root @ rng.standard_normal((n, 3))
    J = J.ravel()
    information = NoiseInformation(np.diag(J), J * error.ravel() + np.sqrt(J) * rng.standard_normal(6 * n))
    found = explored(information, cut, usual, TRIED)
    assert not found[0][1].wanders_alone
    score, noise = found[-1]
    assert noise.wanders_alone
    assert {term.triad for term in noise.terms} == set(TRIADS)
    # No other such noise is a better place to look for effects.
    alone = [t for t in TRIED if t.kind in {RANDOM_WALK, FLICKER}]
    assert score == pytest.approx(explored(information, cut, usual, alone)[0][0])


def test_each_term_may_stand_for_an_effect_and_other_drawn_terms_in_its_place_are_smaller():
    shift, stop, walk = (NoiseTerm("gyro", kind, size=2.0) for kind in (SHIFT, STOP, RANDOM_WALK))
    accel = NoiseTerm("accel", STOP, size=3.0)
    likeliest = NoiseModel((shift, accel), (-1.0, -2.0))
    others = [likeliest, NoiseModel((stop, accel), (-3.0, -2.0)), NoiseModel((walk, accel), (-4.0, -2.0))]
    without = [NoiseModel((accel,), (-2.0,)), NoiseModel((shift,), (-1.0,))]
    smaller = NoiseModel((replace(stop, size=1.0), accel), (-3.0, -2.0))
    assert instead_of(likeliest, others) == [*without, smaller]


def test_of_drawn_kinds_in_the_place_of_others_each_choice_is_tried_once_and_what_wanders_keeps_its_size():
    walk = NoiseTerm("gyro", RANDOM_WALK, size=2.0)
    likeliest = NoiseModel((NoiseTerm("gyro", SHIFT, size=2.0),), (-1.0,))
    attitude = [NoiseModel((NoiseTerm("gyro", "attitude", size=2.0, axes=axes),), (-1.0,)) for axes in SENSORS]
    stop = NoiseModel((NoiseTerm("gyro", STOP, size=2.0), walk), (-1.0, -1.0))
    white, first, second = instead_of(likeliest, [likeliest, *attitude, stop])
    assert white == NoiseModel()
    assert first.terms == (replace(attitude[0].terms[0], size=1.0),)
    assert second.terms == (replace(stop.terms[0], size=1.0), walk)


def test_another_kind_is_tried_in_the_place_of_each_that_wanders():
    walk, flicker, markov = (NoiseTerm("gyro", kind, size=2.0) for kind in (RANDOM_WALK, FLICKER, MARKOV))
    accel = NoiseTerm("accel", FLICKER, size=3.0)

    def noise(*terms):
        return NoiseModel(terms, (-1.0,) * len(terms))

    likeliest = noise(walk, flicker)
    others = [likeliest, noise(walk, markov), noise(walk), noise(accel), noise(markov), noise(markov, accel)]
    assert instead_of(likeliest, others) == [noise(flicker), noise(walk), noise(markov), noise(walk, markov)]


def ramps(rng, cut, usual):
    """Gauss-Markov noise, and a ramp of one sensor by twelve times as much in the whole test."""
    n, size = len(cut), usual.centre["gyro", MARKOV]
    J = (2.0 / size) ** 2
    root = np.linalg.cholesky(kernel(MARKOV, 30.0, cut) + 1e-12 * np.eye(n))
    error = np.zeros((n, 6))
    error[:, :3] = size * root @ rng.standard_normal((n, 3))
    error[:, 0] += np.linspace(-6.0, 6.0, n) * size
    d = J * error.ravel() + np.sqrt(J) * rng.standard_normal(6 * n)
    return NoiseInformation(J * np.eye(6 * n), d)


def test_noise_without_the_kind_that_stands_for_a_ramp_is_found_far_behind(cut, usual):
    """A random walk makes the ramp; beside the ramp Gauss-Markov noise is the likeliest by itself."""
    tried = [NoiseTerm("gyro", RANDOM_WALK), NoiseTerm("gyro", MARKOV, 30.0)]
    behind = []
    for seed in range(6):
        information = ramps(np.random.default_rng(seed), cut, usual)
        (first, likeliest), *others = explored(information, cut, usual, tried)
        assert RANDOM_WALK in {t.kind for t in likeliest.terms}
        own = [(score, {t.kind for t in noise.terms if t.triad == "gyro"}) for score, noise in others]
        behind += [first - score for score, kinds in own if kinds and RANDOM_WALK not in kinds]
    assert min(behind) > 6.0
    assert len(behind) >= 4


def shifted_once(rng, cut, size):
    """Bias drawn anew at each stop, and shifted by three times as much half way."""
    n, J = len(cut), 1.0 / size**2
    root = np.linalg.cholesky(kernel(STOP, 0.0, cut) + 1e-12 * np.eye(n))
    error = np.zeros((n, 6))
    error[:, :3] = size * root @ rng.standard_normal((n, 3))
    error[n // 2 :, 0] += 3.0 * size
    d = J * error.ravel() + np.sqrt(J) * rng.standard_normal(6 * n)
    return NoiseInformation(J * np.eye(6 * n), d)


def test_noise_with_other_drawn_terms_in_the_place_of_the_likeliests_is_found_far_behind_it(cut, usual):
    """The shift makes most of noise that is drawn anew at each stop: without it that noise is far behind."""
    tried, behind = [t for t in TRIED if t.kind in {STOP, TURN, SHIFT}], []
    for seed in range(6):
        information = shifted_once(np.random.default_rng(seed), cut, usual.centre["gyro", STOP])
        first, *others = explored(information, cut, usual, tried)
        alone = [score for score, noise in others if {t.kind for t in noise.terms} == {STOP}]
        behind += [first[0] - score for score in alone]
        assert len(alone) <= 1
    # In one of the six it is more than 30 behind.
    assert len(behind) >= 4
    assert min(behind) > 6.0


def test_other_kinds_are_looked_for_once_beside_the_same_terms_and_in_a_brief_search_not_at_all(
    cut, usual, monkeypatch
):
    looked, without = [], _Search.without

    def noted(self, best, place):
        found = without(self, best, place)
        looked.append((self, best.noise.terms[place].triad, found.noise.kinds))
        return found

    monkeypatch.setattr(_Search, "without", noted)
    information = shifted_once(np.random.default_rng(0), cut, usual.centre["gyro", STOP])
    whole = explored(information, cut, usual)
    # Beside two kinds of noise, and beside a third one that came in the place of one of these.
    assert len(looked) == len(set(looked)) == 3
    looked.clear()
    brief = explored(information, cut, usual, brief=True)
    assert not looked
    assert 0.0 < brief[0][0] < whole[0][0]
