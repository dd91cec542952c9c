"""A clock that is set right in the middle of a test is found by the stamps, told, and costs no more than it must."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sdimu_calibration.core.data.arrival import RawStatus, RawTest, in_order
from sdimu_calibration.core.estimation.outcome import calibrate
from sdimu_calibration.core.recording import DataError

N = 6000
MS = 1_000_000
INTERVAL = 10 * MS
AT = 2345


def raw(ns, seed=1):
    values = np.random.default_rng(seed).normal(size=(len(ns), 6))
    return RawTest(np.asarray(ns, dtype=np.int64), values[:, :3], values[:, 3:])


EVEN = 10**15 + INTERVAL * np.arange(1, N + 1)


def set_by(ns, step_ms, at=AT):
    return np.where(np.arange(len(ns)) >= at, ns + round(step_ms * MS), ns)


@pytest.mark.parametrize("jitter", [0.0, 0.02, 0.04])
@pytest.mark.parametrize("step_ms", [-36.0, -25.0, -10.0, -4.0, 4.0, 25.0, 256.0, 495.0])
def test_a_step_is_found_with_its_time_and_size_and_taken_out(step_ms, jitter):
    rng = np.random.default_rng(2)
    ns = EVEN + np.rint(jitter * INTERVAL * rng.normal(size=N)).astype(np.int64)
    recording = in_order(raw(set_by(ns, step_ms)))
    (step,) = recording.clock_steps
    assert step.size_s == pytest.approx(1e-3 * step_ms, abs=1e-3 * 10.0 * jitter + 1e-9)
    assert step.t == pytest.approx(1e-9 * INTERVAL * (AT + 1), abs=1e-9 * INTERVAL * (0.01 + 6.0 * jitter))
    assert (recording.rejected, len(recording.t)) == (0, N)
    assert np.diff(recording.t).max() < 0.01 * (1.01 + 10.0 * jitter)


def test_several_steps_are_each_found():
    ns = set_by(set_by(set_by(EVEN, 25.0, 1000), -13.0, 3000), 3.0, 5000)
    sizes = [step.size_s for step in in_order(raw(ns)).clock_steps]
    assert sizes == pytest.approx([0.025, -0.013, 0.003])


def test_what_is_no_step_of_the_clock_is_left_to_others():
    order = np.r_[0:500, 501, 500, 502:N]
    jitter = np.rint(3.0 * MS * np.random.default_rng(4).uniform(-1, 1, N)).astype(np.int64)
    late = EVEN.copy()
    late[700] += 6 * MS
    drift = EVEN + np.rint(2e-4 * (EVEN - EVEN[0])).astype(np.int64)
    missing = np.delete(EVEN, slice(900, 930))
    for ns in (EVEN, EVEN[order], EVEN + jitter, late, drift, missing, set_by(EVEN, 30.0), set_by(EVEN, 2005.0)):
        assert in_order(raw(ns)).clock_steps == ()


def test_samples_that_were_sent_twice_are_no_step():
    once = raw(EVEN)
    for again in (np.r_[0:700, 699:N], np.r_[0:700, 698:N], np.r_[0:700, 699 : 699 + 1, 700:N]):
        twice = replace(once, ns=EVEN[again], omega_ib_b=once.omega_ib_b[again], f_ib_b=once.f_ib_b[again])
        recording = in_order(twice)
        assert recording.clock_steps == ()
        np.testing.assert_array_equal(recording.f_ib_b, once.f_ib_b)


def test_the_status_follows_the_clock_that_wrote_it():
    test = raw(set_by(EVEN, 25.0))
    status = RawStatus(test.ns[[1000, 5000]], np.array([True, False]), np.array([0, 0]))
    recording = in_order(replace(test, status=status))
    np.testing.assert_allclose(recording.phase.t, recording.t[[1000, 5000]], rtol=0, atol=1e-9)


def test_a_clock_set_back_over_times_that_other_samples_have_is_refused():
    with pytest.raises(DataError, match=r"set back by 0\.06 s"):
        in_order(raw(set_by(EVEN, -60.0)))


@pytest.mark.parametrize("step_ms", [-10.0, -3.0, 3.0])
def test_a_step_in_a_turn_moves_no_coefficient_beyond_its_sigma(step_ms, recorded_test, three_stops, imu, site, model):
    """Once taken out; that the driver may have paused instead costs sigma, and a line tells it."""
    whole = recorded_test(three_stops, seed=21)
    edge = int(np.argmax(~whole.phase.dwell))
    at = int(np.searchsorted(whole.t, 0.5 * (whole.phase.t[edge] + whole.phase.t[edge + 1])))
    ns = whole.start_ns + np.rint(whole.t * 1e9).astype(np.int64)
    status = RawStatus(
        whole.start_ns + np.rint(whole.phase.t * 1e9).astype(np.int64), whole.phase.dwell, whole.phase.stop
    )
    test = RawTest(ns, whole.omega_ib_b, whole.f_ib_b, status)
    right = calibrate(in_order(test), site, imu, model, held_out=False)
    later = np.where(status.ns >= ns[at], status.ns + round(step_ms * MS), status.ns)
    stepped = replace(test, ns=set_by(ns, step_ms, at), status=status._replace(ns=later))
    found = calibrate(in_order(stepped), site, imu, model, held_out=False)
    # Coefficients that define the body frame are zero.
    free = np.diag(right.covariance) > 0.0
    sigma = np.sqrt(np.diag(found.covariance))[free]
    assert np.all(np.abs(found.values - right.values)[free] < (sigma if step_ms > 0.0 else 0.01 * sigma))
    assert np.all(sigma > 0.999 * np.sqrt(np.diag(right.covariance)[free]))
    (fault,) = found.faults
    assert fault.kind == "clock"
    assert f"{abs(step_ms):.3g} ms" in fault.text
    assert "while the IMU turned" in fault.text
