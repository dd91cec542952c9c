"""The likeliest noise of a fit is there with its size where noise is, and white noise elsewhere."""

from __future__ import annotations

import numpy as np
import pytest

from sdimu_calibration.core.effects.effect import Timetable
from sdimu_calibration.core.evidence.learned_noise import NoiseInformation, kinds, with_intervals
from sdimu_calibration.core.evidence.noise_kernels import kernel, stretches
from sdimu_calibration.core.noise_term import FOLLOWS, KINDS, MARKOV, TRIADS, NoiseTerm
from sdimu_calibration.core.posterior.noise_models import ODDS, SHARE, USUAL_SPREAD, Sizes
from sdimu_calibration.core.posterior.noise_search import _Search, explored, likeliest

STOPS = 12
WANDERING = [k for k in KINDS if k not in FOLLOWS]
"""Kinds that a fit may have."""
USUAL = Sizes(
    {(triad, kind): SHARE[kind] for triad in TRIADS for kind in ODDS},
    {(triad, kind): USUAL_SPREAD for triad in TRIADS for kind in ODDS},
)
"""Bias instability of one, known to a factor of ten."""


@pytest.fixture(scope="module")
def cut():
    """Twelve dwells of 120 s with turns of 40 s between them."""
    stops = tuple((k, 160.0 * k, 160.0 * k + 120.0) for k in range(STOPS))
    turns = tuple((k, 160.0 * k + 120.0, 160.0 * (k + 1)) for k in range(STOPS - 1))
    return stretches(Timetable(160.0 * STOPS - 40.0, stops, turns))


def drawn(cut, terms, seed):
    """Information of an ideal sensor that measures each stretch with a white error of one, wandering by `terms`."""
    rng = np.random.default_rng(seed)
    e = rng.standard_normal(6 * len(cut))
    for term in terms:
        # Of the whole kernel, not of the modes that the program keeps.
        variance, vectors = np.linalg.eigh(kernel(term.kind, term.tau, cut))
        draws = np.sqrt(np.maximum(variance, 0.0))[:, None] * rng.standard_normal((len(cut), 3))
        first = 3 * TRIADS.index(term.triad)
        e.reshape(-1, 6)[:, first : first + 3] += term.size * vectors @ draws
    return NoiseInformation(np.eye(6 * len(cut)), e)


def found_in(information, cut):
    """Likeliest noise of a measurement, with its intervals."""
    return with_intervals(information, cut, likeliest(information, cut, USUAL, kinds(cut)).terms)


@pytest.mark.parametrize("kind", ["random_walk", "flicker"])
def test_noise_far_above_white_noise_keeps_its_name(cut, kind):
    """A wander of many modes is not told as one time constant, however large it is."""
    for seed in range(1, 11):
        found = found_in(drawn(cut, [NoiseTerm("gyro", kind, 0.0, 10.0)], seed), cut)
        of_kind = [t for t in found if t.kind == kind or kind in t.alike]
        assert of_kind, (seed, found)
        assert 7.0 < of_kind[0].size < 14.0


@pytest.mark.parametrize("seeds", [10, pytest.param(20, marks=pytest.mark.slow)])
@pytest.mark.parametrize(("kind", "size"), [(k, 0.2 if k == "random_walk" else 3.0) for k in WANDERING])
def test_the_size_of_a_term_is_inside_its_interval(cut, kind, size, seeds):
    true = NoiseTerm("gyro", kind, 100.0 if kind == MARKOV else 0.0, size)
    inside = named = elsewhere = 0
    for seed in range(1, seeds + 1):
        information = drawn(cut, [true], seed)
        found = found_in(information, cut)
        elsewhere += any(t.triad != "gyro" for t in found)
        own = [t for t in found if t.kind == kind]
        named += bool(own)
        # Of a family that looks alike, the true one is never much worse than the one that was taken.
        assert information.gain(found, cut) > information.gain([true], cut) - 3.0
        inside += any(t.low <= size <= t.high for t in own)
    assert named >= 0.6 * seeds
    assert inside >= 0.75 * named
    # One in twenty is as often as white noise may be taken for another; more than three of twenty are no chance.
    assert elsewhere <= 3 * seeds // 20


def test_noise_far_above_white_noise_has_an_interval(cut):
    """Known better than the grid of sizes is wide: the interval is narrow and holds the truth."""
    many = [NoiseTerm(triad, "shift", 0.0, 3e2) for triad in ("gyro", "accel")]
    found = [t for t in found_in(drawn(cut, many, 5), cut) if t.kind == "shift"]
    assert {t.triad for t in found} == {"gyro", "accel"}
    for term in found:
        assert 0.0 < term.low <= term.size <= term.high < 2.0 * term.low
        assert term.low < 3e2 < term.high


def test_white_noise_is_likeliest_where_there_is_no_other(cut):
    """One false term in twenty tests at most: 9 of a hundred are what chance allows that."""
    assert sum(bool(found_in(drawn(cut, [], seed), cut)) for seed in range(100, 200)) <= 9


def test_noise_of_one_triad_is_not_told_of_the_other(cut):
    true = [NoiseTerm("accel", "random_walk", size=0.3)]
    triads = [{t.triad for t in found_in(drawn(cut, true, seed), cut)} for seed in range(1, 21)]
    assert all("accel" in of for of in triads)
    assert sum("gyro" in of for of in triads) <= 3


def test_the_search_sizes_each_kind_of_noise_once_beside_the_same_noise(cut, monkeypatch):
    """Pairs, exchanges and the search among noise that wanders by itself come back to what was added one by one."""
    terms = [NoiseTerm("gyro", "turn", 0.0, 6.0), NoiseTerm("accel", "random_walk", 0.0, 0.5)]
    asked, plain = [], _Search._in_sensors

    def counted(search, given, alike):
        asked.append((given.J.tobytes(), given.d.tobytes(), tuple(term.identity for term in alike)))
        return plain(search, given, alike)

    monkeypatch.setattr(_Search, "_in_sensors", counted)
    apart = drawn(cut, terms, 3)
    # What one triad is told hangs on the noise of the other.
    found = explored(NoiseInformation(apart.J + 0.01, apart.d), cut, USUAL)
    assert {term.triad for term in found[0][1].terms} == set(TRIADS)
    assert len(asked) > len(kinds(cut))
    assert len(set(asked)) == len(asked)
