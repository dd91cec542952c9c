"""A live calibration of hours: work a sample and memory are those of the first minutes."""

from __future__ import annotations

import gc
import time
import tracemalloc

import numpy as np
import pytest

from sdimu_calibration.core.data.arrival import RawTest
from sdimu_calibration.core.data.axes_and_units import Stated
from sdimu_calibration.core.data.early_reading import EarlyReading
from sdimu_calibration.core.data.intake import Intake
from sdimu_calibration.core.front_door import OpeningOptions
from sdimu_calibration.core.live import NS, LiveCalibration
from sdimu_calibration.core.specification import Model
from sdimu_calibration.storage.files.effect_file import extended_model

START = 1_700_000_000 * NS
RATE = 20
SI = Stated(1.0, 1.0, 1, 1)


def nothing() -> RawTest:
    raise AssertionError("the end is not asked for")


class Hours:
    """A test at rest with a quarter turn there and back every minute, temperature with every sample."""

    def __init__(self, options: OpeningOptions, model: Model) -> None:
        self.live = LiveCalibration(options, model)
        self.live.kept_by(nothing)
        self.second = 0
        self.rng = np.random.default_rng(2)
        self.angle = 0.0

    def run(self, seconds: int) -> None:
        for _ in range(seconds):
            base = START + self.second * NS
            place = self.second % 60
            rate = {50: 0.3, 54: -0.3}.get(place, 0.0) * np.ones(RATE)
            angle = self.angle + np.cumsum(rate) / RATE
            self.angle = float(angle[-1]) if place != 54 else 0.0
            ns = base + (1 + np.arange(RATE, dtype=np.int64)) * (NS // RATE)
            omega = np.column_stack([0.0 * rate, rate, 0.0 * rate]) + 4e-5 + 1e-6 * self.rng.normal(size=(RATE, 3))
            force = 9.8 * np.column_stack([np.sin(angle), 0.0 * angle, -np.cos(angle)])
            self.live.add_phase(base, not rate[0], self.second // 60)
            for at in ns.tolist():
                self.live.add_temperature(at, 20.0 + 1e-4 * self.second)
            self.live.add_samples(ns, omega, force)
            self.live.advance(int(ns[-1]))
            self.second += 1


@pytest.fixture
def hours(imu, site):
    model = extended_model("baseline", ["accel_hysteresis_x", "gyro_bias_temperature"])
    return Hours(OpeningOptions(imu, site, stated=SI), model)


def test_neither_memory_nor_work_grow_with_the_test(hours, monkeypatch):
    # What is kept for passes over everything is let go at its limit, here within the first minutes.
    monkeypatch.setattr("sdimu_calibration.core.live_history.MOST_CYCLES", 700)
    hours.run(300)
    assert hours.live._on_the_way._history.closed
    tracemalloc.start()
    hours.run(60)
    before = memory()
    hours.run(900)
    after = memory()
    tracemalloc.stop()
    # A quarter of an hour of samples is 1 MB, of temperatures 2 MB; what stays is two changes of the status a minute,
    # and what tracemalloc does not see being freed inside of compiled code, 150 bytes a second.
    assert after - before < 300_000
    first = median_work(hours)
    hours.run(1000)
    # A busy machine makes half of it; a log that is sorted at every epoch made thirty times of it.
    assert median_work(hours) < 2.0 * first


def test_what_is_kept_for_passes_is_short_at_rest_and_has_a_limit(hours, monkeypatch):
    hours.run(600)
    history = hours.live._on_the_way._history
    kept, epochs = len(history.prepared().cycles), len(history.prepared().epochs)
    assert epochs == 600
    # Of a minute 8 s turn and 10 s after that keep their ten cycles a second; a turning table closes some early.
    assert kept < 10 * (18 * 10 + 42) + 600
    assert history._cycles == kept
    monkeypatch.setattr("sdimu_calibration.core.live_history.MOST_CYCLES", kept + 100)
    hours.run(200)
    assert history.closed
    assert history.prepared() is None
    before = hours.live._on_the_way._work
    hours.run(300)
    assert hours.live._on_the_way._work == before


def test_passes_take_work_in_proportion_to_the_test(hours):
    for minutes in (5, 10, 15):
        hours.run(60 * minutes - hours.second)
        way = hours.live._on_the_way
        # Four passes at most go beyond what is left of it.
        assert way._work <= 6 * way._epochs + 3000 + 4 * way._epochs
    assert way._work > way._epochs


def memory() -> int:
    """Bytes in use; what only points at itself is let go first."""
    gc.collect()
    return tracemalloc.get_traced_memory()[0]


def median_work(hours, seconds=120):
    """Time of the processor (s) that a second of data takes."""
    spent = []
    for _ in range(seconds):
        begun = time.process_time()
        hours.run(1)
        spent.append(time.process_time() - begun)
    return np.median(spent)


def test_temperatures_that_are_forgotten_are_missed_by_nobody(hours):
    """The same estimates as with a log that is kept whole."""
    whole = Hours(hours.live.options, hours.live.setup.model)
    whole.live._intake.forget = lambda _: None
    for one in (hours, whole):
        one.run(400)
    assert len(hours.live._intake.temperature_log().t) < 70 * RATE < len(whole.live._intake.temperature_log().t)
    assert len(hours.live._intake.phase_log().t) < 100
    np.testing.assert_array_equal(hours.live._on_the_way.state.P, whole.live._on_the_way.state.P)
    np.testing.assert_array_equal(hours.live._on_the_way.state.used, whole.live._on_the_way.state.used)


@pytest.mark.parametrize("started", [False, True])
def test_statuses_of_hours_without_samples_leave_the_changes(hours, started):
    """A table that speaks at 200 Hz while the IMU is silent, from the start or in the middle of a test."""
    live = hours.live
    if started:
        hours.run(60)
    begin = START + 60 * NS
    for k in range(300_000):
        live.add_phase(begin + k * NS // 200, k // 20_000 % 2 == 0, k // 40_000)
    assert len(live._intake._status.ns) < 40_000
    # A sixth of a second late: it holds where it belongs.
    live.add_phase(begin + 300_000 * NS // 200 - NS // 6, False, 99)
    samples = np.tile([0.0, 0.0, -9.8], (RATE * 3, 1))
    live.add_samples(begin + (1 + np.arange(len(samples), dtype=np.int64)) * (NS // RATE), 0.0 * samples, samples)
    log = live._intake.phase_log()
    first = (begin - live._intake.origin_ns) / NS
    change = np.flatnonzero((np.diff(log.stop) != 0) | np.diff(log.dwell)) + 1
    change = change[log.t[change] > first]
    expected = [*(100.0 * np.arange(1, 15)), 1500.0 - 1.0 / 6.0, 1500.0 - 32.0 / 200.0]
    np.testing.assert_allclose(log.t[change] - first, expected, atol=0.006)


def test_a_sample_of_another_year_is_no_wait_of_a_year(hours):
    hours.run(60)
    hours.live.add_samples(np.array([START + 365 * 86_400 * NS]), np.zeros((1, 3)), np.array([[0.0, 0.0, -9.8]]))
    begun = time.process_time()
    hours.live.advance(START + 366 * 86_400 * NS)
    assert time.process_time() - begun < 1.0


@pytest.mark.parametrize("wrong", ["not a number", "one stamp"])
def test_samples_that_never_tell_a_time_do_not_pile_up(wrong):
    intake = Intake()
    for k in range(1000):
        ns = START + (np.arange(20, dtype=np.int64) + 20 * k) * (wrong == "not a number")
        omega = np.full((20, 3), np.nan if wrong == "not a number" else 0.0)
        intake.add_samples(ns, omega, omega)
    assert intake.origin_ns is None
    assert sum(len(ns) for ns, _, _ in intake._queue) <= 5020
    assert intake.rejected >= 20_000 - 5020


def test_the_filter_does_not_wait_for_a_turn_for_ever(monkeypatch):
    monkeypatch.setattr("sdimu_calibration.core.data.early_reading._HELD", 3000)
    reading, rng = EarlyReading(Stated()), np.random.default_rng(1)
    for second in range(200):
        t = second + (1.0 + np.arange(20)) / 20
        force = np.array([0.0, 0.0, -9.8]) + 1e-3 * rng.normal(size=(20, 3))
        assert reading.read(t, 1e-5 * rng.normal(size=(20, 3)), force, second + 1.0, final=False) is None
        if reading.gave_up:
            break
    assert second == 150
    assert not reading._held
    assert "--gyro-unit" in reading.notes[-1]
