"""Single wrong samples are taken away, also where they are many, and a shock that rings is not."""

from __future__ import annotations

import numpy as np
import pytest

from sdimu_calibration.core.data.sample_screening import sound, wild
from sdimu_calibration.core.recording import Recording

N = 60_000


def recording(rng, channels):
    noise = rng.normal(size=(N, 6))
    noise[:, : channels.shape[1]] += channels
    return Recording(start_ns=0, t=0.05 * np.arange(1, N + 1), omega_ib_b=noise[:, :3], f_ib_b=noise[:, 3:])


@pytest.mark.parametrize("share", [1e-3, 1e-2])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_wrong_samples_that_lie_near_each_other_are_found_all_the_same(seed, share):
    rng = np.random.default_rng(seed)
    hit = rng.random(N) < share
    given = recording(rng, 20.0 * hit[:, None] * rng.choice((-1.0, 1.0), (N, 1)))
    mended, (fault,) = sound(given)
    kept = np.isin(given.t, mended.t)
    assert fault.kind == "spike"
    assert fault.text.startswith("gyro x jumps away and back")
    # Two beside each other, about a share of the square, look like a short step.
    assert np.count_nonzero(kept & hit) <= 5 * share * np.count_nonzero(hit) + 1
    assert np.count_nonzero(~kept & ~hit) <= 0.02 * np.count_nonzero(hit)


def test_one_line_tells_of_all_channels_that_jump_together():
    rng = np.random.default_rng(4)
    hit = rng.random(N) < 1e-3
    _mended, faults = sound(recording(rng, np.repeat(20.0 * hit[:, None], 4, axis=1)))
    assert len(faults) == 1
    assert faults[0].text.startswith("gyro x, gyro y, gyro z and accelerometer x jump away and back")


@pytest.mark.parametrize("phase", [0.0, 0.25, 0.5])
def test_the_peak_of_a_turn_without_a_steady_part_is_no_spike(phase):
    rng = np.random.default_rng(6)
    turn = 20.0 * (50.0 - np.abs(np.arange(101) - 50.0 + phase))
    rate = np.zeros((N, 1))
    for first in range(1000, N - 1000, 500):
        rate[first : first + 101, 0] += turn
    given = recording(rng, rate)
    assert len(sound(given)[0].t) == N


def test_a_shock_that_rings_stays():
    rng = np.random.default_rng(5)
    rung = np.zeros((N, 1))
    n = np.arange(60)
    for first in range(1000, N - 1000, 1000):
        rung[first : first + 60, 0] += 40.0 * np.exp(-n / 10.0) * np.cos(n * rng.uniform(0.3, 2.0))
    given = recording(rng, rung)
    mended, _faults = sound(given)
    # A shock at nearly half the sampling rate alternates as a spike does; one in ten may lose a sample.
    assert len(given.t) - len(mended.t) <= 6


def test_a_counter_that_repeats_a_number_while_its_remainder_grows_is_not_stuck():
    """Pulses coarser than the noise: at one stop hardly any number repeats, at another hundreds do."""
    rng = np.random.default_rng(7)
    rate = np.repeat([0.5, 0.5, 0.5, 0.995], N // 4) + 0.001 * rng.standard_normal(N)
    pulses = np.diff(np.floor(np.cumsum(rate)), prepend=0.0)
    given = recording(rng, np.zeros((N, 6)))
    counted = np.column_stack([3e-7 * pulses, given.omega_ib_b[:, 1:]])
    assert len(sound(Recording(0, given.t, counted, given.f_ib_b))[0].t) == N


def test_coarse_counts_on_a_base_that_rocks_are_not_stuck_and_a_stuck_one_is_found():
    """Calm parts of the rocking repeat a number more often than the usual sample does."""
    rng = np.random.default_rng(8)
    at = np.arange(N)
    sway = 1.25 * np.exp(1.0 * np.sin(at / 300.0)) * rng.standard_normal(N)
    given = recording(rng, np.zeros((N, 6)))
    counted = np.column_stack([1e-5 * np.round(sway), given.omega_ib_b[:, 1:]])
    assert not [f for f in sound(Recording(0, given.t, counted, given.f_ib_b))[1] if f.kind == "stuck"]
    counted[4000:4600, 0] = counted[4000, 0]
    left, faults = sound(Recording(0, given.t, counted, given.f_ib_b))
    assert 590 <= N - len(left.t) <= 620
    assert "stuck" in {f.kind for f in faults}


def brisk_turns(rng, steady):
    """Twelve turns with ramps of three samples, `steady` samples long between them, in noise of one."""
    rate = np.zeros(N)
    for begin in rng.integers(1000, N - 1000, 12):
        rate[begin : begin + 3] += 5000.0 * np.array([0.25, 0.5, 0.75])
        rate[begin + 3 : begin + 3 + steady] += 5000.0
        rate[begin + 3 + steady : begin + 6 + steady] += 5000.0 * np.array([0.75, 0.5, 0.25])
    return recording(rng, rate[:, None])


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("steady", [8, 25, 60])
def test_a_brisk_turn_is_not_rough(seed, steady):
    assert wild(brisk_turns(np.random.default_rng(seed), steady))[2] == ()


@pytest.mark.parametrize("size", [8.0, 50.0])
def test_a_disturbed_line_is_rough_at_rest_and_in_a_steady_turn(size):
    rng = np.random.default_rng(6)
    given = recording(rng, np.zeros((N, 1)))
    given.omega_ib_b[20_000:40_000] += 3000.0
    for begin in (10_000, 30_000):
        given.f_ib_b[begin : begin + 200, 1] += size * rng.normal(size=200)
        given.omega_ib_b[begin : begin + 200, 2] += size * rng.normal(size=200)
    t, _, faults = wild(given)
    assert {fault.text.split(" is ")[0] for fault in faults} == {"gyro z", "accelerometer y"}
    assert np.abs(t[t < 1000.0] - 505.0).max() < 6.0
    assert np.abs(t[t > 1000.0] - 1505.0).max() < 6.0


def test_one_wild_reading_does_not_make_a_channel_noiseless():
    rng = np.random.default_rng(8)
    given = recording(rng, np.zeros((N, 1)))
    given.omega_ib_b[5000, 0] = 1e30
    left, faults = sound(given)
    assert "spike" in {fault.kind for fault in faults}
    assert len(left.t) == N - 1
