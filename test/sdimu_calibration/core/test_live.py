"""The filter fed in pieces: the same digits however the pieces were cut, and the same as offline."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from sdimu_calibration.core.estimation.outcome import calibrate
from sdimu_calibration.core.filter.passes import SNAPSHOT_EPOCHS
from sdimu_calibration.core.live import LiveCalibration
from sdimu_calibration.core.recording import DataError, seconds


@pytest.fixture(scope="module")
def memory():
    return {}


@pytest.fixture
def recording(memory, recorded_test, three_stops):
    """One simulated test for all examples."""
    if "recording" not in memory:
        made = recorded_test(three_stops, seed=21)
        # Times as they come out of stamps: whole nanoseconds, by the one conversion there is.
        by_stamps = seconds(np.rint(made.t * 1e9).astype(np.int64), 0)
        phase = replace(made.phase, t=seconds(np.rint(made.phase.t * 1e9).astype(np.int64), 0))
        memory["recording"] = replace(made, t=by_stamps, phase=phase)
    return memory["recording"]


def feed(recording, site, imu, model, lengths, lag_s=0.0):
    """Give a recording to a live calibration in blocks; return it with all its estimates."""
    live = LiveCalibration(site, imu, model, recording.start_ns)
    estimates, at, entry, blocks = [], 0, 0, [*lengths, len(recording.t)]
    for length in blocks:
        rows = slice(at, min(at + length, len(recording.t)))
        if rows.start == rows.stop:
            continue
        live.add_samples(recording.t[rows], recording.omega_ib_b[rows], recording.f_ib_b[rows])
        at = rows.stop
        until = recording.t[at - 1]
        while entry < len(recording.phase.t) and recording.phase.t[entry] <= until:
            live.add_phase(
                recording.phase.t[entry], bool(recording.phase.dwell[entry]), int(recording.phase.stop[entry])
            )
            entry += 1
        estimates += live.advance(until - lag_s)
    estimates += live.advance(recording.t[-1])
    return live, estimates


@settings(
    max_examples=12,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
    deadline=None,
)
@given(lengths=st.lists(st.one_of(st.integers(1, 30), st.integers(100, 1500)), min_size=1, max_size=25))
def test_estimates_do_not_depend_on_how_samples_came(lengths, memory, recording, site, imu, model):
    if "whole" not in memory:
        memory["whole"] = feed(recording, site, imu, model, [])[1]
    whole = memory["whole"]
    _, pieces = feed(recording, site, imu, model, lengths)
    assert len(pieces) == len(whole) >= 36
    for a, b in zip(pieces, whole, strict=True):
        assert (a.t, a.dwell, a.used, a.stop, a.nis) == (b.t, b.dwell, b.used, b.stop, b.nis)
        for name in ("coefficients", "covariance", "velocity", "q_nb", "navigation_covariance"):
            np.testing.assert_array_equal(getattr(a, name), getattr(b, name), err_msg=name)


def test_the_end_of_a_live_test_is_the_offline_answer(recording, site, imu, model):
    live, _ = feed(recording, site, imu, model, [997] * 3)
    ended, offline = live.finish(), calibrate(recording, site, imu, model)
    np.testing.assert_array_equal(ended.values, offline.values)
    np.testing.assert_array_equal(ended.covariance, offline.covariance)
    assert ended.fit == offline.fit


def test_stepping_is_the_first_pass_of_the_offline_answer(recording, site, imu, model):
    _, estimates = feed(recording, site, imu, model, [333] * 20)
    history = calibrate(recording, site, imu, model, held_out=False).history
    rows = estimates[::SNAPSHOT_EPOCHS]
    assert len(rows) == len(history.t)
    np.testing.assert_allclose([e.t for e in rows], history.t, rtol=0, atol=1e-9)
    np.testing.assert_array_equal([e.coefficients for e in rows], history.value)


def test_late_and_unusable_samples_are_counted_and_dropped(recording, site, imu, model):
    live = LiveCalibration(site, imu, model, recording.start_ns)
    t, w, f = recording.t[:3000].copy(), recording.omega_ib_b[:3000].copy(), recording.f_ib_b[:3000].copy()
    order = np.arange(3000)
    order[[700, 701]] = [701, 700]
    w[1500] = np.nan
    live.add_samples(t[order], w[order], f[order])
    live.add_samples(t[100:103], w[100:103], f[100:103])
    counts = live.advance(29.0, status_known=False)[-1].counts
    assert counts["late"] == 1 + 3
    assert counts["rejected"] == 1 + 3 + 1
    assert counts["lost"] == 2
    assert counts["samples"] == 3000 - 2


def test_nothing_comes_out_before_there_is_an_attitude_and_then_it_catches_up(recording, site, imu, model):
    live = LiveCalibration(site, imu, model, recording.start_ns)
    first = []
    for k in range(0, 1500, 100):
        rows = slice(k, k + 100)
        live.add_samples(recording.t[rows], recording.omega_ib_b[rows], recording.f_ib_b[rows])
        first.append(len(live.advance(recording.t[rows.stop - 1], status_known=False)))
    # The first dwell of 10 s ends before the 30 s of an alignment: the turn that ends it starts the filter.
    assert first[:10] == [0] * 10
    assert sum(first) == 15


def test_finishing_without_samples_says_so(site, imu, model):
    with pytest.raises(DataError, match="too few samples"):
        LiveCalibration(site, imu, model, 0).finish()
