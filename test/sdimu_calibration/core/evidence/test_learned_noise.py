"""Kernels of noise with a memory are covariances of means, and its likelihood is that of the whole covariance."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sdimu_calibration.core.effects.effect import Timetable
from sdimu_calibration.core.evidence.conditions import Conditions
from sdimu_calibration.core.evidence.in_stops import InStops
from sdimu_calibration.core.evidence.learned_noise import InModes, NoiseInformation
from sdimu_calibration.core.evidence.noise_kernels import kernel, stretches
from sdimu_calibration.core.evidence.noise_root import columns_of, root_of
from sdimu_calibration.core.evidence.wander import Wander
from sdimu_calibration.core.noise_term import ATTITUDE, FOLLOWS, KINDS, MARKOV, RATE, TEMPERATURE, TRIADS, NoiseTerm

STOPS = 12
WANDERING = [k for k in KINDS if k not in FOLLOWS]
"""Kinds of means over time; an error that follows something is a function of other than time."""


@pytest.fixture(scope="module")
def cut():
    """Twelve dwells of 120 s with turns of 40 s between them."""
    stops = tuple((k, 160.0 * k, 160.0 * k + 120.0) for k in range(STOPS))
    turns = tuple((k, 160.0 * k + 120.0, 160.0 * (k + 1)) for k in range(STOPS - 1))
    return stretches(Timetable(160.0 * STOPS - 40.0, stops, turns))


def test_stretches_cover_dwells_and_turns(cut):
    assert cut.start[0] == 0.0
    np.testing.assert_allclose(cut.start[1:], cut.end[:-1])
    assert not cut.turning[0]
    assert (cut.end - cut.start).max() <= 30.0


@pytest.mark.parametrize("kind", [k for k in WANDERING if k != "flicker"])
def test_a_kernel_is_the_mean_of_the_covariance_of_seconds(cut, kind):
    """Against brute force: the covariance second by second, averaged over the stretches."""
    t = np.arange(0.5, cut.end[-1])
    block, within = t // 160.0, t % 160.0
    turning = within > 120.0
    passed = block + 0.5 * turning
    same = block[:, None] == block[None, :]
    C = {
        "random_walk": np.minimum.outer(t, t),
        "markov": np.exp(-np.abs(t[:, None] - t[None, :]) / 100.0),
        "stop": same & ~turning[:, None] & ~turning[None, :],
        "turn": same & turning[:, None] & turning[None, :],
        "shift": np.minimum.outer(passed, passed),
    }[kind].astype(float)
    mean = np.array([((t > a) & (t < b)) / ((t > a) & (t < b)).sum() for a, b in zip(cut.start, cut.end, strict=True)])
    K = kernel(kind, 100.0 if kind == MARKOV else 0.0, cut)
    np.testing.assert_allclose(K, mean @ C @ mean.T, atol=2e-3, rtol=1e-3)


def test_an_error_that_follows_the_attitude_is_one_where_the_force_points_the_same_way(cut):
    """Two stretches share its halves by the square of their distance over 17 and 52 deg, at any time between them."""
    tilt = np.where(cut.interval % 4 == 0, 0.0, np.where(cut.interval % 4 == 2, 2.0 * np.arcsin(0.15), np.pi))
    force = np.column_stack([np.sin(tilt), np.zeros(len(cut)), np.cos(tilt)])
    seen = Conditions(force, np.zeros_like(force), np.zeros(len(cut)))
    K = kernel(ATTITUDE, 0.0, replace(cut, conditions=seen))
    apart = np.abs(np.subtract.outer(tilt, tilt))
    same, near = apart < 1e-9, np.isclose(apart, 2.0 * np.arcsin(0.15))
    np.testing.assert_allclose(K[same], 1.0)
    np.testing.assert_allclose(K[near], 0.5 * (np.exp(-0.5) + np.exp(-0.5 / 9.0)))
    opposite = np.isclose(apart, np.pi)
    np.testing.assert_allclose(K[opposite], 0.5 * np.exp(-0.5 * (2.0 / 0.9) ** 2), rtol=1e-6)
    assert K[~same & ~near].max() < 0.06
    np.testing.assert_array_equal(kernel(ATTITUDE, 0.0, cut), 1.0)


def test_an_error_that_follows_the_rate_is_zero_at_rest_and_one_in_turns_of_the_same_rate(cut):
    rate = np.where(cut.turning, np.where(cut.interval % 4 == 1, 0.1, -0.1), 0.0)[:, None] * np.array([0.0, 0.0, 1.0])
    K = kernel(RATE, 0.0, replace(cut, conditions=Conditions(np.ones_like(rate), rate, np.zeros(len(cut)))))
    assert not K[~cut.turning].any()
    same = np.equal.outer(rate[:, 2], rate[:, 2]) & np.logical_and.outer(cut.turning, cut.turning)
    np.testing.assert_allclose(K[same], 1.0, atol=1e-4)
    other = np.less.outer(rate[:, 2], rate[:, 2]) & np.logical_and.outer(cut.turning, cut.turning)
    np.testing.assert_allclose(K[other], 0.0, atol=1e-4)


def test_an_error_follows_a_temperature_that_changes(cut):
    heat = np.linspace(20.0, 30.0, len(cut))
    seen = Conditions(np.ones((len(cut), 3)), np.zeros((len(cut), 3)), heat)
    assert seen.followed == (ATTITUDE, TEMPERATURE)
    assert replace(seen, temperature=np.full(len(cut), 20.0)).followed == (ATTITUDE,)
    K = kernel(TEMPERATURE, 0.0, replace(cut, conditions=seen))
    # Over a quarter of the span it falls to exp(-1/2).
    apart = np.subtract.outer(heat, heat)
    np.testing.assert_allclose(K, np.exp(-0.5 * (apart / 2.5) ** 2))


def test_flicker_has_the_allan_deviation_of_its_name():
    """Half the mean square of differences of neighbouring means is (2 ln 2 / pi) B^2 (IEEE Std 952, annex C)."""
    dwells = tuple((k, 30.0 * k, 30.0 * k + 30.0) for k in range(40))
    K = kernel("flicker", 0.0, stretches(Timetable(1200.0, dwells, ())))
    difference = np.diag(K)[1:] + np.diag(K)[:-1] - 2.0 * np.diag(K, 1)
    assert 0.5 * difference.mean() == pytest.approx(2.0 * np.log(2.0) / np.pi, rel=0.05)


@pytest.mark.parametrize("kind", KINDS)
def test_the_modes_of_a_term_make_its_whole_kernel(cut, kind):
    root = cut.mode(kind, 100.0 if kind == MARKOV else 0.0)
    np.testing.assert_allclose(root @ root.T, kernel(kind, 100.0 if kind == MARKOV else 0.0, cut), atol=1e-6)


def test_the_mean_of_the_noise_counts_the_modes_that_no_measurement_sees(cut):
    """An accelerometer that is seen in one stretch of four wanders in the others, too."""
    U = np.eye(6 * len(cut))
    U[:, np.repeat(np.arange(len(cut)) % 4 > 0, 6)] = 0.0
    terms = (NoiseTerm("gyro", "flicker", 0.0, 2.0), NoiseTerm("accel", "random_walk", 0.0, 0.3))
    modes = Wander(cut, InStops.of(U, np.zeros(len(U), dtype=np.int64))).modes(terms)
    share = np.where(cut.turning, 0.0, cut.end - cut.start)
    share /= share.sum()
    total = modes.mean @ modes.mean.T + modes.unseen
    for first, term in ((0, terms[0]), (3, terms[1])):
        variance = term.size**2 * share @ kernel(term.kind, term.tau, cut) @ share
        np.testing.assert_allclose(np.diag(total)[first : first + 3], variance, rtol=1e-9)
    assert np.diag(modes.unseen).min() > 0.0


def test_a_test_that_begins_in_a_turn_shifts_by_it(cut):
    begun = replace(cut, turning=~cut.turning)
    assert begun.turning[0]
    K = kernel("shift", 0.0, begun)
    assert np.linalg.eigvalsh(K)[0] > -1e-9
    assert K[0, 0] == 0.5


def of_some_sensors(cut):
    """Terms of two sensors of each triad and of a whole triad, beside one of another sensor, on any information."""
    terms = (
        NoiseTerm("accel", MARKOV, 100.0, 2.0, axes=(1,)),
        NoiseTerm("gyro", "random_walk", 0.0, 0.2),
        NoiseTerm("accel", "stop", 0.0, 1.5),
        NoiseTerm("gyro", "shift", 0.0, 0.7, axes=(0, 2)),
    )
    rng = np.random.default_rng(5)
    W = rng.standard_normal((400, 6 * len(cut)))
    information = NoiseInformation(W.T @ W / 400.0, W.T @ rng.standard_normal(400) / 20.0)
    return terms, information


def covariance(cut, terms):
    """Covariance of the mean errors by the kernels, cell by sensor."""
    K = np.zeros((len(cut), 6, len(cut), 6))
    for term in terms:
        for axis in term.axes:
            channel = 3 * TRIADS.index(term.triad) + axis
            K[:, channel, :, channel] += term.size**2 * kernel(term.kind, term.tau, cut)
    return K.reshape(6 * len(cut), -1)


def test_noise_of_one_sensor_is_in_that_sensor_alone(cut):
    terms, _ = of_some_sensors(cut)
    R, columns = root_of(terms, cut), columns_of(terms, cut)
    np.testing.assert_allclose(R @ R.T, covariance(cut, terms), atol=1e-5)
    assert sorted(np.concatenate(columns).tolist()) == list(range(R.shape[1]))
    for term, own in zip(terms, columns, strict=True):
        np.testing.assert_allclose(R[:, own] @ R[:, own].T, covariance(cut, [term]), atol=1e-5)


def test_terms_of_the_same_sensors_have_one_root_but_what_follows_something_its_own(cut):
    walk, flicker = NoiseTerm("gyro", "random_walk", 0.0, 0.2), NoiseTerm("gyro", "flicker", 0.0, 0.7)
    terms = (walk, NoiseTerm("gyro", "rate", 0.0, 0.3), flicker)
    R, columns = root_of(terms, cut), columns_of(terms, cut)
    np.testing.assert_allclose(R @ R.T, covariance(cut, terms), atol=1e-9)
    for members, own in (([walk, flicker], columns[0]), ([terms[1]], columns[1])):
        np.testing.assert_allclose(R[:, own] @ R[:, own].T, covariance(cut, members), atol=1e-9)
    assert np.array_equal(columns[0], columns[2])
    assert R.shape[1] == 3 * len(cut) + len(columns[1])


def test_what_noise_of_some_sensors_adds_is_that_of_the_whole_covariance(cut):
    """Beside other terms, against the dense likelihood."""
    terms, information = of_some_sensors(cut)
    one, *others = terms
    given = information.of_triad("accel", others, cut)
    size, gain = InModes.of(given, cut, one.kind, one.tau).sizes_on_grid(one.axes)
    near = int(np.argmin(np.abs(np.log(size / one.size))))
    with_it = (replace(one, size=float(size[near])), *others)

    def dense(members):
        K = covariance(cut, members)
        M = np.eye(len(K)) + K @ information.J
        return 0.5 * information.d @ np.linalg.solve(M, K @ information.d) - 0.5 * np.linalg.slogdet(M)[1]

    assert gain[near] == pytest.approx(dense(with_it) - dense(others), abs=1e-4)
    assert given.gain == pytest.approx(dense(others), abs=1e-4)
    assert information.gain(with_it, cut) == pytest.approx(dense(with_it), abs=1e-4)
