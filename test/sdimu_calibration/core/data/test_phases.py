"""Dwell or not: the table's word, checked against what the IMU feels."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sdimu_calibration.core import earth
from sdimu_calibration.core.alignment.prepared import reduce, set_up
from sdimu_calibration.core.data.epochs import Epochs
from sdimu_calibration.core.data.phases import (
    STALE_S,
    PhaseState,
    classify,
    rest_limits,
    table_says,
    without_early_motion,
)
from sdimu_calibration.core.estimation.outcome import calibrate
from sdimu_calibration.core.plan import Plan, Turn
from sdimu_calibration.core.recording import DataError, PhaseLog

GRAVITY = 9.8
TURN_RATE = 0.03


def epochs_of(moving, force=GRAVITY):
    """One-second epochs; `moving` says in which the IMU turns."""
    moving = np.asarray(moving, dtype=bool)
    m = len(moving)
    t = np.arange(m, dtype=float)
    peak = np.where(moving, TURN_RATE, earth.RATE)
    f = np.tile([0.6, 0.0, -0.8], (m, 1)) * np.broadcast_to(force, (m,))[:, None]
    none = np.zeros(m, dtype=np.int64)
    return Epochs(none, none, t, t + 1.0, peak, f, np.zeros((m, 3)))


def log_of(entries):
    t, dwell, stop = zip(*entries, strict=True)
    return PhaseLog(np.array(t, dtype=float), np.array(dwell), np.array(stop, dtype=np.int64))


def at_one_hertz(dwell, stop=None):
    """A status at every second."""
    stop = stop if stop is not None else [0] * len(dwell)
    return log_of([(k, d, s) for k, (d, s) in enumerate(zip(dwell, stop, strict=True))])


def phases_of(epochs, log, imu, settle=0.0, state=None):
    return classify(epochs, log, rest_limits(imu), GRAVITY, settle, state or PhaseState())


def test_a_status_that_contradicts_the_imu_is_counted_and_not_used(imu):
    moving = np.zeros(20, dtype=bool)
    moving[8:13] = True
    phases = phases_of(epochs_of(moving), at_one_hertz([True] * 20), imu)
    np.testing.assert_array_equal(phases.contradicted, moving)
    assert not (phases.used & moving).any()
    assert phases.used[~moving].all()


def test_a_force_that_is_not_gravity_is_motion_too(imu):
    force = np.full(20, GRAVITY)
    force[5] += 0.5
    phases = phases_of(epochs_of(np.zeros(20), force), at_one_hertz([True] * 20), imu)
    assert not phases.used[5]
    assert phases.contradicted[5]


def test_the_table_may_say_rotating_while_the_imu_feels_nothing(imu):
    """A slow turn hides below the guard: then the table is believed."""
    dwell = [True] * 5 + [False] * 5 + [True] * 5
    phases = phases_of(epochs_of(np.zeros(15)), at_one_hertz(dwell), imu)
    np.testing.assert_array_equal(phases.used, dwell)
    assert not phases.contradicted.any()


def test_an_epoch_with_any_rotation_in_it_is_not_dwell(imu):
    log = log_of([(0.0, True, 0), (2.4, False, 0), (2.6, True, 1), (3.5, True, 1), (4.5, True, 1)])
    phases = phases_of(epochs_of(np.zeros(5)), log, imu)
    np.testing.assert_array_equal(phases.dwell, [True, True, False, True, True])


def test_where_the_status_is_stale_or_missing_the_imu_decides(imu):
    moving = np.zeros(20, dtype=bool)
    moving[10:14] = True
    # The last word, at 3 s, was "rotating".
    log = log_of([(0.0, True, 0), (1.0, True, 0), (2.0, True, 0), (3.0, False, 0)])
    said, _ = table_says(epochs_of(moving), log)
    known = np.arange(20) + 1.0 - 3.0 <= STALE_S
    np.testing.assert_array_equal(said == -1, ~known)
    for entry in (log, None):
        phases = phases_of(epochs_of(moving), entry, imu)
        np.testing.assert_array_equal(phases.used[6:], ~moving[6:])


def test_no_measurement_before_the_settling_time_is_over(imu):
    moving = np.zeros(20, dtype=bool)
    moving[5:8] = True
    phases = phases_of(epochs_of(moving), None, imu, settle=2.0)
    np.testing.assert_array_equal(np.flatnonzero(~phases.used), [5, 6, 7, 8, 9])
    assert phases.dwell[8]
    np.testing.assert_array_equal(np.flatnonzero(phases.first), [10])


def test_stops_are_counted_without_a_status_and_named_with_one(imu):
    moving = np.isin(np.arange(15), [4, 5, 9])
    np.testing.assert_array_equal(phases_of(epochs_of(moving), None, imu).stop[[0, 7, 12]], [0, 1, 2])
    log = at_one_hertz(~moving, [3] * 6 + [7] * 4 + [9] * 5)
    np.testing.assert_array_equal(phases_of(epochs_of(moving), log, imu).stop[[0, 7, 12]], [3, 7, 9])


@pytest.mark.parametrize("cut", range(1, 19))
def test_phases_do_not_depend_on_where_a_block_ends(cut, imu):
    moving = np.isin(np.arange(20), [5, 6, 12])
    epochs, log = epochs_of(moving), at_one_hertz([True] * 20, [0] * 6 + [1] * 7 + [2] * 7)
    whole = phases_of(epochs, log, imu, settle=2.0)
    state, parts = PhaseState(), []
    for rows in (slice(0, cut), slice(cut, 20)):
        block = Epochs(*(getattr(epochs, n)[rows] for n in Epochs.__dataclass_fields__))
        parts.append(phases_of(block, log, imu, settle=2.0, state=state))
    for name in ("dwell", "used", "first", "stop", "contradicted"):
        joined = np.concatenate([getattr(p, name) for p in parts])
        np.testing.assert_array_equal(joined, getattr(whole, name), err_msg=name)


def test_limits_of_rest_let_every_imu_of_the_specification_rest_and_no_table_turn_pass(imu):
    limits = rest_limits(imu)
    # Three sigma of bias on every axis, and Earth rate, is rest; the slowest turn of a test is not.
    assert limits.rate > earth.RATE + 3 * np.sqrt(3) * imu.prior["gyro_bias"]
    assert limits.rate < np.radians(0.1)
    assert limits.force > 3 * imu.prior["accel_bias"]


def test_a_lying_table_changes_nothing_but_the_count(recorded_test, three_stops, site, imu, model):
    """Status says dwell throughout: the guard finds the turns, and the answer is that of a test without status."""
    recording = recorded_test(three_stops, seed=5)
    lie = replace(recording, phase=PhaseLog(np.arange(60.0), np.ones(60, dtype=bool), np.zeros(60, dtype=np.int64)))
    told = calibrate(lie, site, imu, model, held_out=False)
    silent = calibrate(replace(recording, phase=None), site, imu, model, held_out=False)
    np.testing.assert_array_equal(told.values, silent.values)
    np.testing.assert_array_equal(told.covariance, silent.covariance)
    turning = sum(abs(turn.angle_rad) / turn.rate_rad_s for turn in three_stops.turns)
    assert told.data["contradicted_s"] == pytest.approx(turning, abs=2.5)
    assert silent.data["contradicted_s"] == 0.0


def test_used_epochs_of_a_simulated_test_are_at_rest(recorded_test, three_stops, site, imu, model):
    recording = recorded_test(three_stops, seed=5)
    prepared = reduce(recording, set_up(site, imu, model))
    phases = prepared.phases
    assert len(np.unique(phases.stop[phases.used])) == 3
    assert prepared.epochs.peak_rate[phases.used].max() < np.radians(0.02)
    assert phases.used.sum() >= 3 * 10 - 6


def test_a_recording_that_starts_in_motion_is_refused_in_one_line(recorded_test, three_stops, site, imu, model):
    recording = recorded_test(three_stops, seed=5)
    rows = recording.t > 11.0
    late = replace(
        recording,
        t=recording.t[rows] - 11.0,
        omega_ib_b=recording.omega_ib_b[rows],
        f_ib_b=recording.f_ib_b[rows],
        phase=None,
    )
    with pytest.raises(DataError, match=r"/imu/data_raw.*starts in motion") as caught:
        calibrate(late, site, imu, model)
    assert "\n" not in str(caught.value)


def test_a_recording_that_never_rests_is_refused_in_one_line(recorded_test, site, imu, model):
    turning = Plan("no rest", (3.0, 3.0), (Turn("X", 3.0, 0.1),), 1.0)
    recording = recorded_test(turning, seed=1)
    rows = (recording.t > 4.5) & (recording.t < 30.0)
    moving = replace(
        recording,
        t=recording.t[rows] - 4.5,
        omega_ib_b=recording.omega_ib_b[rows],
        f_ib_b=recording.f_ib_b[rows],
        phase=None,
    )
    with pytest.raises(DataError, match=r"/imu/data_raw.*never at rest") as caught:
        calibrate(moving, site, imu, model)
    assert "\n" not in str(caught.value)


def test_force_in_g_is_refused_with_a_word_on_units(recorded_test, three_stops, site, imu, model):
    recording = recorded_test(three_stops, seed=5)
    with pytest.raises(DataError, match="units"):
        calibrate(replace(recording, f_ib_b=recording.f_ib_b / 9.80665), site, imu, model)


def with_a_gentle_start(imu, rng):
    """Forty seconds of rest, a turn, forty of rest; the turn begins within the last second before it is noticed."""
    moving = np.zeros(100, dtype=bool)
    moving[40:60] = True
    epochs = epochs_of(moving)
    rate = rng.normal(0.0, imu.gyro_white_noise, (100, 3))
    rate[40:60, 1] += TURN_RATE
    rate[39, 1] += 100.0 * imu.gyro_white_noise
    return replace(epochs, w_mean=rate)


def test_a_turn_that_begins_gently_is_not_taken_for_rest_where_no_table_speaks(imu):
    epochs = with_a_gentle_start(imu, np.random.default_rng(1))
    phases = phases_of(epochs, None, imu)
    assert phases.used[39]
    mended = without_early_motion(epochs, None, phases, imu.gyro_white_noise)
    np.testing.assert_array_equal(np.flatnonzero(phases.used & ~mended.used), [39])
    assert not mended.dwell[39]
    np.testing.assert_array_equal(mended.stop, phases.stop)


def test_what_the_table_calls_a_dwell_stays_one(imu):
    epochs = with_a_gentle_start(imu, np.random.default_rng(2))
    log = at_one_hertz([True] * 40 + [False] * 20 + [True] * 40)
    phases = phases_of(epochs, log, imu)
    mended = without_early_motion(epochs, log, phases, imu.gyro_white_noise)
    np.testing.assert_array_equal(mended.used, phases.used)


def test_a_rate_that_lasts_after_a_turn_is_left_for_the_diagnosis(imu):
    """A sensor may be off after a turn, never before one."""
    epochs = with_a_gentle_start(imu, np.random.default_rng(3))
    epochs.w_mean[60:63, 0] += 100.0 * imu.gyro_white_noise
    phases = phases_of(epochs, None, imu)
    mended = without_early_motion(epochs, None, phases, imu.gyro_white_noise)
    assert mended.used[60:].all()
