"""Stamps of arrival in packets are replaced by the count of the samples; no sample is invented and none is lost."""

from __future__ import annotations

import numpy as np
import pytest

from sdimu_calibration.core.data.arrival import RawTest, in_order
from sdimu_calibration.core.data.bursts import find_bursts
from sdimu_calibration.core.data.dejitter import dejittered

N, RATE = 20_000, 104.0
TRUE = np.arange(1, N + 1) / RATE


def arrived(packet: int, seed: int = 1, resolution_s: float = 1e-9):
    """Stamps (ns) of samples that leave by the packet, each up to 12 ms late and every hundredth twice as late."""
    rng = np.random.default_rng(seed)
    last = (np.arange(N) // packet + 1) * packet / RATE
    late = np.where(np.arange(N) // packet % 100 == 99, packet / RATE, 0.0)
    delay = np.repeat(rng.uniform(0.0, 12e-3, N // packet + 1), packet)[:N]
    return np.sort(np.rint((last + late + delay) / resolution_s) * resolution_s * 1e9).astype(np.int64)


def recording(ns):
    reading = np.random.default_rng(7).standard_normal((len(ns), 3))
    return dejittered(in_order(RawTest(ns, reading, reading + np.array([0.0, 0.0, 9.8]))))


@pytest.mark.parametrize("packet", [2, 5, 13, 52])
@pytest.mark.parametrize("resolution_s", [1e-9, 1e-2])
def test_bursts_become_even_stamps_at_the_rate_of_the_samples(packet, resolution_s):
    found = recording(arrived(packet, resolution_s=resolution_s))
    assert len(found.t) == N
    assert found.rejected == 0
    # The rate over three minutes is as good as the delay of a packet (a quarter of it as noise) and its length allow.
    assert found.interval_s == pytest.approx(1.0 / RATE, rel=1e-4)
    assert np.ptp(np.diff(found.t)) < 1e-8
    assert "bursts" in found.notes[0]
    assert "104" in found.notes[0]


def test_a_pause_of_the_link_stays_a_gap():
    ns = arrived(8)
    ns[12_000:] += 30_000_000_000
    found = recording(ns)
    steps = np.diff(found.t)
    assert len(found.t) == N
    assert np.flatnonzero(steps > 1.0).tolist() == [11_999]
    assert steps[11_999] == pytest.approx(30.0, abs=2 * 8 / RATE)


def test_even_and_jittering_stamps_and_missing_samples_are_no_bursts():
    rng = np.random.default_rng(3)
    even = np.rint(TRUE * 1e9).astype(np.int64)
    jitter = np.sort(even + np.rint(rng.uniform(-0.4, 0.4, N) / RATE * 1e9).astype(np.int64))
    lost = even[rng.uniform(size=N) < 0.6]
    parts = even + 60_000_000_000 * (np.arange(N) // 500)
    for ns in (even, jitter, lost, parts):
        assert find_bursts(ns) is None


def test_messages_that_were_sent_twice_are_no_bursts():
    again = np.repeat(np.arange(N // 2), 2)
    reading = np.random.default_rng(7).standard_normal((N // 2, 3))[again]
    ns = np.rint(TRUE * 1e9).astype(np.int64)[again]
    found = in_order(RawTest(ns, reading, reading))
    assert len(found.t) == N // 2
    assert found.interval_s == pytest.approx(1.0 / RATE)
