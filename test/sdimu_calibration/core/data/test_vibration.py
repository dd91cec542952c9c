"""A table that vibrates at rest: the status is taken at its word, the scatter is weighed, what moves stays motion."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from sdimu_calibration.core.alignment.prepared import reduce, set_up, weighed_for
from sdimu_calibration.core.estimation.outcome import outcome
from sdimu_calibration.core.estimation.prepared_test import PreparedTest
from sdimu_calibration.core.estimation.solve import solve
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.specification import Site
from sdimu_calibration.core.units import to_si
from sdimu_calibration.storage.files.config import load_imu, load_model, load_plan
from sdimu_sim.core.scenario import Scenario, generate
from sdimu_study import disturbed
from sdimu_study.score import baseline_z

IMU, MODEL, SITE = load_imu("dtg"), load_model("baseline"), Site(float(np.radians(36.4)), 80.0)
SETUP = set_up(SITE, IMU, MODEL)
AXIS = np.array([2.0, -1.0, 2.0]) / 3.0


@cache
def recorded():
    plan = load_plan("kim18_signed")
    plan = replace(plan, dwell_s=(60.0,) * len(plan.dwell_s))
    return generate(Scenario(plan, IMU, SITE, rate_hz=100.0, seed=141))


def shaken(recording, arcsec, hertz, only=slice(None)):
    """The recording on a table that swings about an axis, all the time or in some samples."""
    swing = np.zeros(len(recording.t))
    swing[only] = arcsec
    return disturbed.shaken(recording, swing, hertz, AXIS)


@cache
def fitted(arcsec, hertz):
    return solve(PreparedTest(shaken(recorded()[0], arcsec, hertz), IMU, SITE), MODEL)


@pytest.mark.parametrize("hertz", [17.0, 17.3])
def test_a_table_that_vibrates_is_calibrated_with_honest_sigmas(hertz):
    result = outcome(fitted(2.0, hertz))
    z = baseline_z(result, recorded()[1].imu)
    # 27 errors over sigma: their RMS scatters by a seventh.
    assert 0.6 < np.sqrt(np.mean(z**2)) < 1.45
    # 27 000 squares: by chance within two per cent.
    assert result.fit["nis_mean"] == pytest.approx(1.0, abs=0.05)
    assert result.fit["held_out_rms"] == pytest.approx(1.0, abs=0.1)
    assert not result.warnings
    (note,) = [line for line in result.notes if "vibrates in its dwells" in line]
    assert "\n" not in note


def test_what_a_vibration_does_to_a_second_is_measured():
    prepared = reduce(shaken(recorded()[0], 2.0, 17.3), SETUP)
    # Per axis of the triad, root mean square; a second ends 0.3 of a period later than it began.
    angle = to_si(2.0, "arcsec") / np.sqrt(2.0 * 3.0)
    assert prepared.shaking == pytest.approx(2.0 * np.sin(0.3 * np.pi) * angle, rel=0.1)
    weighed = weighed_for(SETUP, prepared)
    assert weighed.shaken
    assert weighed.model.extra_rate_sigma == prepared.shaking


@pytest.mark.parametrize(("arcsec", "hertz"), [(1.0, 31.0), (0.5, 44.0)])
def test_a_vibration_below_the_limit_of_rest_is_seen_because_it_is_bounded(arcsec, hertz):
    prepared = reduce(shaken(recorded()[0], arcsec, hertz), SETUP)
    assert prepared.shaking is not None
    assert not prepared.phases.contradicted.any()


def test_white_noise_above_the_specification_is_no_vibration():
    recording = recorded()[0]
    noise = 5.0 * IMU.gyro_white_noise / np.sqrt(recording.interval_s)
    loud = recording.omega_ib_b + noise * np.random.default_rng(5).standard_normal(recording.omega_ib_b.shape)
    assert reduce(replace(recording, omega_ib_b=loud), SETUP).shaking is None


def test_a_table_that_stands_still_is_weighed_as_before():
    prepared = reduce(recorded()[0], SETUP)
    assert prepared.shaking is None
    assert weighed_for(SETUP, prepared) is SETUP
    assert not any(fault.kind == "vibration" for fault in prepared.faults)


def test_somebody_who_leans_on_the_table_is_no_vibration_of_it():
    recording = recorded()[0]
    # Ten seconds of the third dwell.
    begin = int(np.searchsorted(recording.t, recording.phase.t[np.flatnonzero(recording.phase.dwell)[2]] + 20.0))
    prepared = reduce(shaken(recording, 2.0, 17.0, slice(begin, begin + 1000)), SETUP)
    assert prepared.shaking is None
    assert prepared.phases.contradicted.sum() >= 8


def test_a_knock_on_a_table_that_vibrates_is_no_rest():
    recording = recorded()[0]
    begin = int(np.searchsorted(recording.t, 20.0))
    knocked = shaken(shaken(recording, 2.0, 17.0), 12.0, 17.0, slice(begin, begin + 300))
    prepared = reduce(knocked, SETUP)
    assert prepared.shaking is not None
    seconds = np.flatnonzero(prepared.phases.contradicted)
    assert {20, 21, 22} <= set(seconds.tolist())
    assert len(seconds) < 6


def test_without_a_status_nobody_says_that_a_shaking_imu_rests():
    alone = replace(shaken(recorded()[0], 2.0, 17.0), phase=None)
    with pytest.raises(DataError, match="never at rest"):
        solve(PreparedTest(alone, IMU, SITE), MODEL)
