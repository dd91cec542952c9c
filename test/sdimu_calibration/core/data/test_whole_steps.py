"""A clock set on by whole sample intervals in a turn is told from missing samples by gravity in the rests about it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rate_table_sim.core.specification import TableSpecification
from sdimu_calibration.core.data.arrival import RawStatus, RawTest, in_order
from sdimu_calibration.core.data.whole_steps import without_whole_steps
from sdimu_calibration.core.estimation.outcome import calibrate
from sdimu_calibration.core.front_door import OpeningOptions, open_test
from sdimu_calibration.core.plan import Plan, Turn
from sdimu_calibration.storage.files.config import load_imu, load_site
from sdimu_sim.core.scenario import Scenario, generate

RATE_HZ = 50
MS = 1_000_000
AXES = "YYZZXXYXZYYXXYYXX"
PLAN = Plan(
    "ten turns", (20.0,) * 18, tuple(Turn(axis, np.pi / 2, np.radians(10.0)) for axis in AXES), np.radians(60.0)
)


@pytest.fixture(scope="module")
def whole():
    table = TableSpecification(axes=None)
    r = generate(Scenario(PLAN, load_imu("dtg"), load_site("daejeon"), table=table, seed=5, rate_hz=RATE_HZ))[0]
    status = RawStatus(r.start_ns + np.rint(r.phase.t * 1e9).astype(np.int64), r.phase.dwell, r.phase.stop)
    return RawTest(r.start_ns + np.rint(r.t * 1e9).astype(np.int64), r.omega_ib_b, r.f_ib_b, status)


def middle_of_turn(test, number):
    begins = test.status.ns[1:][~test.status.dwell[1:] & test.status.dwell[:-1]]
    return int(np.searchsorted(test.ns, begins[number] + 4_000 * MS))


def set_on(test, at, step_ms):
    """The clock of samples and status, set on."""
    by = step_ms * MS
    status = test.status._replace(ns=np.where(test.status.ns >= test.ns[at], test.status.ns + by, test.status.ns))
    return replace(test, ns=np.where(np.arange(len(test.ns)) >= at, test.ns + by, test.ns), status=status)


def lose(test, at, samples):
    kept = np.r_[0:at, at + samples : len(test.ns)]
    return replace(test, ns=test.ns[kept], omega_ib_b=test.omega_ib_b[kept], f_ib_b=test.f_ib_b[kept])


@pytest.mark.parametrize("intervals", [1, 3])
@pytest.mark.parametrize("turn", [0, 4, 6])
def test_a_step_by_whole_intervals_is_found_and_as_many_missing_samples_are_none(whole, turn, intervals):
    at = middle_of_turn(whole, turn)
    step_ms = intervals * 1000 // RATE_HZ
    (step,) = without_whole_steps(in_order(set_on(whole, at, step_ms))).clock_steps
    assert step.size_s == pytest.approx(1e-3 * step_ms, abs=1e-9)
    right = in_order(whole)
    mended = without_whole_steps(in_order(set_on(whole, at, step_ms)))
    np.testing.assert_allclose(mended.t, right.t, rtol=0, atol=1e-6)
    np.testing.assert_allclose(mended.phase.t, right.phase.t, rtol=0, atol=1e-6)
    missing = in_order(lose(whole, at, intervals))
    assert without_whole_steps(missing) is missing


def test_a_step_in_one_turn_and_missing_samples_in_another_are_each_what_they_are(whole):
    first, second = middle_of_turn(whole, 0), middle_of_turn(whole, 2)
    (step,) = without_whole_steps(in_order(lose(set_on(whole, first, 20), second, 2))).clock_steps
    assert step.t == pytest.approx(in_order(whole).t[first], abs=1e-6)


def test_a_turn_about_the_vertical_leaves_it_open(whole):
    vertical = in_order(set_on(whole, middle_of_turn(whole, 2), 20))
    assert without_whole_steps(vertical) is vertical


def test_no_coefficient_moves_beyond_its_sigma_and_the_step_is_told(whole, imu, site, model):
    options = OpeningOptions(imu, site)
    right = calibrate(open_test(in_order(whole), options).recording, site, imu, model, held_out=False)
    stepped = open_test(in_order(set_on(whole, middle_of_turn(whole, 4), 20)), options).recording
    found = calibrate(stepped, site, imu, model, held_out=False)
    free = np.diag(right.covariance) > 0.0
    sigma = np.sqrt(np.diag(found.covariance))[free]
    assert np.all(np.abs(found.values - right.values)[free] < sigma)
    (fault,) = found.faults
    assert fault.kind == "clock"
    assert "20 ms" in fault.text
    assert "while the IMU turned: samples are taken as even" in fault.text
