"""Samples with a stamp of another time are told by the order of arrival, in a recording and on the way alike."""

from __future__ import annotations

import numpy as np
import pytest

from sdimu_calibration.core.data.arrival import RawTest, in_order
from sdimu_calibration.core.data.stray_stamps import NEVER, StampSieve, stray_stamps

START = 1_700_000_000 * 10**9
STEP = 10_000_000
DAY = 86_400 * 10**9
N = 2000


def even(count=N):
    return START + (1 + np.arange(count, dtype=np.int64)) * STEP


def motion(count=N):
    """Rates and forces at rest, with noise."""
    rng = np.random.default_rng(1)
    return 1e-5 * rng.normal(size=(count, 3)), np.array([0.0, 0.0, -9.8]) + 1e-3 * rng.normal(size=(count, 3))


def sieved(ns, size):
    """Stamps that the sieve lets through, of blocks of a size, and those that it leaves out."""
    sieve, zeros = StampSieve(), np.zeros((len(ns), 3))
    pieces = [slice(k, k + size) for k in range(0, len(ns), size)]
    blocks = [sieve.take(ns[rows], zeros[rows], zeros[rows])[0] for rows in pieces]
    return np.concatenate(blocks), sieve.strays(), sieve


def stepped(rows, ns, stamp):
    ns[rows] = stamp
    return ns


WRONG = {
    "years ahead": ([500], 2_000_000_000 * 10**9),
    "a day ahead": ([500], START + 501 * STEP + DAY),
    "an hour back": ([500], START - DAY // 24),
    "zero": ([500], 0),
    "three in a row": ([500, 501, 502], START + 400 * DAY),
    "one between": ([500, 502, 900], START + 400 * DAY),
    "the first": ([0], START + 400 * DAY),
}


@pytest.mark.parametrize("which", WRONG)
@pytest.mark.parametrize("size", [1, 7, N])
def test_a_stamp_of_another_time_is_left_out_on_the_way_and_at_the_end(which, size):
    rows, stamp = WRONG[which]
    ns = stepped(rows, even(), stamp)
    assert stray_stamps(ns).tolist() == rows
    passed, strays, sieve = sieved(ns, size)
    np.testing.assert_array_equal(passed, np.delete(ns, rows))
    assert strays.tolist() == [stamp] * len(rows)
    assert (sieve.first_ns, sieve.newest_ns) == (passed[0], passed[-1])


@pytest.mark.parametrize("which", WRONG)
def test_a_recording_without_the_stray_sample_has_the_same_digits(which):
    rows, stamp = WRONG[which]
    ns, (omega, force) = stepped(rows, even(), stamp), motion()
    keep = np.delete(np.arange(N), rows)
    found, expected = in_order(RawTest(ns, omega, force)), in_order(RawTest(ns[keep], omega[keep], force[keep]))
    assert found.start_ns == expected.start_ns
    np.testing.assert_array_equal(found.t, expected.t)
    np.testing.assert_array_equal(found.omega_ib_b, expected.omega_ib_b)
    assert found.rejected == len(rows)
    assert "outside the test (" in found.notes[0]
    assert "left out" in found.notes[0]


def test_a_stray_at_the_end_is_left_out_and_waits_on_the_way():
    ns = stepped([N - 1], even(), START + 400 * DAY)
    assert stray_stamps(ns).tolist() == [N - 1]
    passed, strays, sieve = sieved(ns, 20)
    assert len(passed) == N - 1
    assert not len(strays)
    assert sieve.newest_ns == ns[-2]


def test_a_stray_beside_a_gap_is_none_of_the_test_either():
    ns = even()
    ns[1000:] += DAY
    ns[1000] += 400 * DAY
    assert stray_stamps(ns).tolist() == [1000]
    np.testing.assert_array_equal(sieved(ns, 20)[0], np.delete(ns, 1000))


def test_a_clock_that_is_set_and_two_publishers_in_turn_are_no_strays():
    ns = even()
    ns[1000:] += 400 * DAY
    assert not len(stray_stamps(ns))
    np.testing.assert_array_equal(sieved(ns, 20)[0], ns)
    ns = even()
    ns[::2] += 400 * DAY
    assert not len(stray_stamps(ns))
    passed, strays, _ = sieved(ns, 20)
    assert N - 1 <= len(passed) + len(strays) <= N
    assert len(passed) >= N / 2


def test_what_is_in_order_passes_as_it_is():
    assert not len(stray_stamps(np.empty(0, dtype=np.int64)))
    assert not len(stray_stamps(even(1)))
    sieve, ns, zeros = StampSieve(), even(), np.zeros((N, 3))
    assert sieve.newest_ns == NEVER
    assert len(sieve.take(ns[:10], zeros[:10], zeros[:10])[0]) == 10
    assert sieve.take(ns[10:20], zeros[10:20], zeros[10:20])[0].base is ns
