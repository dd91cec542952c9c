"""A status on another clock is brought onto that of the IMU by the motion both saw; one on the same clock is left."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from sdimu_calibration.core.data.status_clock import aligned
from sdimu_calibration.core.plan import Plan
from sdimu_calibration.core.recording import PhaseLog
from sdimu_calibration.storage.files.config import load_imu, load_plan, load_site
from sdimu_sim.core.scenario import Scenario, generate

KIM18 = load_plan("kim18")
HURRIED = Plan(
    "kim18 in a hurry",
    (20.0,) * len(KIM18.dwell_s),
    tuple(replace(turn, rate_rad_s=np.radians(9.0)) for turn in KIM18.turns),
    np.radians(9.0),
)
GRID_S = 0.4
"""The window of motion (0.25 s to the root of two) is what a change of motion is known to."""


@cache
def recorded(seed: int):
    """Simulate a test; the status repeated at 1 Hz."""
    r, _ = generate(Scenario(HURRIED, load_imu("dtg"), load_site("daejeon"), rate_hz=20.0, seed=seed))
    t = np.unique(np.concatenate([r.phase.t, np.arange(0.0, r.t[-1])]))
    row = np.searchsorted(r.phase.t, t, side="right") - 1
    return replace(r, phase=PhaseLog(t, r.phase.dwell[row], r.phase.stop[row]))


def shifted(seed: int, by: float):
    r = recorded(seed)
    return replace(r, phase=replace(r.phase, t=r.phase.t + by))


@pytest.mark.parametrize("seed", range(61, 65))
@pytest.mark.parametrize("by", [0.0, 0.3, -0.3])
def test_a_status_that_is_on_time_is_left_as_it_is(seed, by):
    r = shifted(seed, by)
    assert aligned(r) is r


@pytest.mark.parametrize("seed", range(61, 65))
@pytest.mark.parametrize("by", [1.5, -2.0, 4.0, -9.0, 35.0, -250.0, 1.7e9])
def test_an_offset_of_any_size_is_found_and_told(seed, by):
    found = aligned(shifted(seed, by))
    assert np.abs(found.phase.t - recorded(seed).phase.t).max() < GRID_S
    assert "against the motion of the IMU" in found.notes[-1]


def test_a_status_that_ends_half_way_is_aligned_too():
    r = shifted(62, 30.0)
    half = len(r.phase.t) // 2
    log = PhaseLog(r.phase.t[:half], r.phase.dwell[:half], r.phase.stop[:half])
    found = aligned(replace(r, phase=log))
    assert np.abs(found.phase.t - recorded(62).phase.t[:half]).max() < GRID_S


def test_single_lies_do_not_move_the_clock():
    r = recorded(63)
    rng = np.random.default_rng(7)
    dwell = r.phase.dwell.copy()
    for at in rng.integers(0, len(dwell) - 5, 4):
        dwell[at : at + 4] = ~dwell[at : at + 4]
    lying = replace(r, phase=replace(r.phase, dwell=dwell))
    assert aligned(lying) is lying


def test_a_status_of_another_time_and_test_is_not_used():
    r = recorded(64)
    t = np.arange(0.0, 300.0)
    log = PhaseLog(t + 1e6, t % 7.0 < 3.0, (t // 7.0).astype(np.int64))
    found = aligned(replace(r, phase=log))
    assert found.phase is None
    assert "not used" in found.notes[-1]


def test_nothing_is_moved_without_status_or_motion():
    r = recorded(61)
    assert aligned(silent := replace(r, phase=None)) is silent
    still = replace(r, omega_ib_b=np.zeros_like(r.omega_ib_b), f_ib_b=np.tile([0.0, 0.0, -9.8], (len(r.t), 1)))
    assert aligned(still) is still
