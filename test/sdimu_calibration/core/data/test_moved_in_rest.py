"""A base that tilts within a rest is motion where gyros and accelerometers see one angle, and nothing else is."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from sdimu_calibration.core.alignment.prepared import reduce, set_up
from sdimu_calibration.core.estimation.outcome import outcome
from sdimu_calibration.core.estimation.prepared_test import PreparedTest
from sdimu_calibration.core.estimation.solve import solve
from sdimu_calibration.core.rotation import rotation_matrix
from sdimu_calibration.core.specification import Site
from sdimu_calibration.core.units import to_si
from sdimu_calibration.storage.files.config import load_imu, load_model, load_plan
from sdimu_sim.core.scenario import Scenario, generate
from sdimu_study.score import baseline_z

IMU, MODEL, SITE = load_imu("dtg"), load_model("baseline"), Site(float(np.radians(36.4)), 80.0)
SETUP = set_up(SITE, IMU, MODEL)
AXIS, SECONDS = np.array([1.0, 2.0, 2.0]) / 3.0, 2.0


@cache
def recorded(effects=()):
    plan = load_plan("kim18_signed")
    plan = replace(plan, dwell_s=(60.0,) * len(plan.dwell_s))
    return generate(Scenario(plan, IMU, SITE, rate_hz=20.0, seed=151, effects=effects))


def middle_of(recording, number):
    """Middle (s) of a stop of the status."""
    at = recording.phase.t[(recording.phase.stop == number) & recording.phase.dwell]
    return float(at[0]) + 30.0


def tilted(recording, at_s, arcsec, of_gyros=1.0):
    """The recording of an IMU that tilts on its mount from `at_s` on; its gyros see a share of the angle."""
    angle = to_si(arcsec, "arcsec") * np.clip((recording.t - at_s) / SECONDS, 0.0, 1.0)
    R = np.array([rotation_matrix(-a * AXIS) for a in angle])
    rate = np.diff(angle, prepend=0.0) / recording.interval_s
    w = np.einsum("kij,kj->ki", R, recording.omega_ib_b) + of_gyros * rate[:, None] * AXIS
    return replace(recording, omega_ib_b=w, f_ib_b=np.einsum("kij,kj->ki", R, recording.f_ib_b))


def told(recording):
    return [fault.text for fault in reduce(recording, SETUP).faults if fault.kind == "motion at rest"]


@pytest.mark.parametrize("silent", [False, True], ids=["status", "no status"])
def test_a_tilt_is_motion_and_the_coefficients_stay_right(silent):
    recording, truth = recorded()
    at = middle_of(recording, 6)
    moved = tilted(recording, at, 20.0)
    moved = replace(moved, phase=None) if silent else moved
    prepared = reduce(moved, SETUP)
    during = (prepared.epochs.end > at) & (prepared.epochs.start < at + SECONDS)
    assert not prepared.phases.used[during].any()
    assert (~prepared.phases.dwell & (np.abs(prepared.epochs.start - at - 1.0) < 25.0)).sum() <= 6
    (fault,) = [one for one in prepared.faults if one.kind == "motion at rest"]
    assert "tilted 1 time within its rests" in fault.text
    # Of the angle that about the vertical is not seen by the forces; noise adds a few arcsec.
    force = moved.f_ib_b[(moved.t > at - 20.0) & (moved.t < at)].mean(axis=0)
    shown = 20.0 * np.linalg.norm(np.cross(AXIS, force)) / np.linalg.norm(force)
    assert float(re.search(r"up to (\d+) arcsec", fault.text)[1]) == pytest.approx(shown, abs=3.0)
    assert not fault.grave
    z = baseline_z(outcome(solve(PreparedTest(moved, IMU, SITE), MODEL)), truth.imu)
    assert np.sqrt(np.mean(z**2)) < 1.5
    assert np.max(np.abs(z)) < 4.5


def test_a_tilt_is_seen_in_a_recording_of_a_minute():
    recording = recorded()[0]
    at = middle_of(recording, 6)
    moved = tilted(recording, at, 20.0)
    rows = np.abs(recording.t - at) <= 28.0
    omega, force = moved.omega_ib_b[rows], moved.f_ib_b[rows]
    short = replace(moved, t=moved.t[rows] - at + 28.0, omega_ib_b=omega, f_ib_b=force, phase=None, table=None)
    (fault,) = told(short)
    assert "tilted 1 time within" in fault


def test_tilts_in_all_rests_are_seen():
    recording = recorded()[0]
    for stop in range(19):
        recording = tilted(recording, middle_of(recorded()[0], stop), 20.0)
    (fault,) = told(recording)
    assert "tilted 19 times within" in fault


@pytest.mark.parametrize("settle_s", [1.0, 8.0])
def test_a_tilt_settles_as_a_turn_does(settle_s):
    recording = recorded()[0]
    at = middle_of(recording, 6)
    setup = replace(SETUP, model=replace(MODEL, settle_s=settle_s))
    prepared = reduce(tilted(recording, at, 20.0), setup)
    after = prepared.epochs.start >= at + SECONDS
    first = prepared.epochs.start[after & prepared.phases.used][0]
    assert settle_s <= first - at - SECONDS <= settle_s + 2.0
    assert prepared.phases.first[after & prepared.phases.used][0]


def test_stops_after_a_tilt_have_numbers_of_their_own_without_a_status():
    recording = replace(recorded()[0], phase=None)
    plain = reduce(recording, SETUP).phases
    prepared = reduce(tilted(recording, middle_of(recorded()[0], 6), 20.0), SETUP)
    assert prepared.phases.stop[-1] == plain.stop[-1] + 1
    begins = np.flatnonzero(np.diff(prepared.phases.stop[prepared.phases.used]) != 0) + 1
    assert prepared.phases.first[prepared.phases.used][begins].all()


@pytest.mark.parametrize("of_gyros", [0.0, -1.0, 0.4])
def test_what_one_triad_alone_sees_stays_an_error_of_it(of_gyros):
    recording = recorded()[0]
    assert told(tilted(recording, middle_of(recording, 6), 20.0, of_gyros)) == []


@pytest.mark.parametrize("effect", ["accel_bias_step_x(t0=1000 s)=300 ug", "gyro_bias_step_y(t0=1000 s)=5 deg/h"])
def test_a_step_of_a_bias_is_no_tilt(effect):
    assert told(recorded((effect,))[0]) == []


@pytest.mark.parametrize("arcsec", [0.0, 1.0])
def test_what_noise_hides_is_no_tilt(arcsec):
    recording = recorded()[0]
    assert told(tilted(recording, middle_of(recording, 6), arcsec)) == []
