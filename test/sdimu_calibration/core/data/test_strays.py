"""One message of another time stretches nothing: it is told and left out; a topic with another clock is kept."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest

from sdimu_calibration.core.data.arrival import RawStatus, RawTemperature, RawTest, in_order
from sdimu_calibration.core.data.status_clock import aligned
from sdimu_calibration.core.data.stray_stamps import strays

START = 1_700_000_000 * 10**9
DAY = 86_400 * 10**9
YEAR = 365 * DAY
STAMPS = {
    "zero": (0, "1970-01-01T00:00:00Z"),
    "ago": (START - YEAR, "2022-11-14"),
    "ahead": (START + YEAR, "2024-11-13"),
}


def raw_test(status_ns, samples_ns=None, temperature=None):
    """Two minutes of turns and rests of ten seconds; the status as it should be at `status_ns`."""
    ns = START + (1 + np.arange(6000, dtype=np.int64)) * 20_000_000 if samples_ns is None else samples_ns
    turning = ((ns - START) // (10 * 10**9)) % 2 == 1
    omega = np.where(turning[:, None], [0.0, 0.3, 0.0], 0.0) + 1e-6 * np.random.default_rng(1).normal(size=(len(ns), 3))
    angle = np.cumsum(np.where(turning, 0.3 * 0.02, 0.0))
    force = 9.8 * np.column_stack([np.sin(angle), 0.0 * angle, -np.cos(angle)])
    said = RawStatus(status_ns, ((status_ns - START) // (10 * 10**9)) % 2 == 0, np.zeros(len(status_ns), np.int64))
    return RawTest(ns, omega, force, said, temperature)


def each_second():
    return START + np.arange(121, dtype=np.int64) * 10**9


@pytest.mark.parametrize("which", STAMPS)
@pytest.mark.parametrize("clock_s", [0, 5, 1_000_000])
def test_a_status_of_another_time_is_told_and_costs_no_memory(which, clock_s):
    ns, date = STAMPS[which]
    test = raw_test(each_second())
    late = test.status._replace(
        ns=np.append(test.status.ns + clock_s * 10**9, ns),
        dwell=np.append(test.status.dwell, True),
        stop=np.append(test.status.stop, 7),
    )
    tracemalloc.start()
    found = aligned(in_order(RawTest(test.ns, test.omega_ib_b, test.f_ib_b, late)))
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 30e6
    assert len(found.phase.t) == 121
    assert abs(found.phase.t[0]) < 1.0
    told = " ".join(found.notes)
    assert "/rate_table/status: 1 message has a stamp outside the test" in told
    assert date in told


def test_a_temperature_of_another_time_is_no_beginning():
    heat = RawTemperature(np.append(each_second(), 0), np.append(np.full(121, 20.0), 85.0))
    found = in_order(raw_test(each_second(), temperature=heat))
    assert (found.temperature.value == 20.0).all()
    assert "/imu/temperature: 1 message has" in found.notes[-1]


def test_samples_and_status_of_many_years_are_not_laid_out():
    ns = raw_test(each_second()).ns.copy()
    ns[:10] = np.arange(10)
    tracemalloc.start()
    found = aligned(in_order(raw_test(np.append(each_second(), 0), ns)))
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 30e6
    assert "two weeks" in found.notes[-1]


def test_a_status_that_flickers_for_hours_is_compared_in_little_memory():
    n = 20_000
    status_ns = START + np.arange(n, dtype=np.int64) * 10**8
    test = raw_test(each_second())
    flicker = RawStatus(status_ns, np.arange(n) % 2 == 0, np.zeros(n, np.int64))
    tracemalloc.start()
    aligned(in_order(RawTest(test.ns, test.omega_ib_b, test.f_ib_b, flicker)))
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 30e6


@pytest.mark.parametrize("offset", [0, DAY // 2, -30 * DAY, 20 * YEAR, -START])
def test_a_clock_of_its_own_is_no_stray(offset):
    samples = START + (1 + np.arange(6000, dtype=np.int64)) * 20_000_000
    assert not strays(each_second() + offset, samples).any()


def test_a_test_with_a_pause_of_days_keeps_its_status():
    samples = START + (1 + np.arange(6000, dtype=np.int64)) * 20_000_000
    both = np.concatenate([samples, samples + 5 * DAY])
    assert not strays(np.concatenate([each_second(), each_second() + 5 * DAY]), both).any()
