"""Moves: corners of a trapezoid that keep the limits, and a joint for every turn."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.interpolate import CubicHermiteSpline

from sdimu_calibration.core.plan import Plan, Turn
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.table import AxisLimits, RateTable, Step, is_possible, moves_of, plan_move, steps_of

DEG = math.pi / 180
LIMITS = AxisLimits(50 * DEG, 30 * DEG, angle_rad=400 * DEG, cable_turns=1.0)
TABLE = RateTable("t", ("Y", "Z", "X"), ("outer", "middle", "inner"), (LIMITS, LIMITS, LIMITS))


def step(axis: str, angle_deg: float, rate_degps: float, dwell_s: float = 10.0) -> Step:
    return Step(Turn(axis, angle_deg * DEG, rate_degps * DEG), dwell_s)


@given(angle=st.floats(1.0, 350.0), rate=st.floats(0.5, 20.0), sense=st.sampled_from([-1, 1]))
def test_the_cubic_through_the_corners_keeps_the_limits_and_takes_the_time_of_the_mean_rate(angle, rate, sense):
    wanted = step("X", sense * angle, rate)
    # A trapezoid exists when the ramps leave room: A / a <= (T / 2)^2, with the grid on top.
    assume(angle / 30.0 < 0.95 * (0.5 * angle / rate) ** 2)
    move = plan_move(TABLE, np.zeros(3), wanted)
    assert move.turn_s == pytest.approx(angle / rate, abs=0.0101)
    assert move.duration_s == pytest.approx(move.turn_s + 10.0)
    times = [0.0, *(p.time_s for p in move.waypoints)]
    curve = CubicHermiteSpline(
        times, [0.0, *(p.angles[2] for p in move.waypoints)], [0.0, *(p.rates[2] for p in move.waypoints)]
    )
    t = np.linspace(0.0, move.turn_s, 2001)
    assert np.abs(curve(t, 1)).max() <= LIMITS.rate_rad_s * (1 + 1e-9)
    assert np.abs(curve(t[:-1], 2)).max() <= LIMITS.acceleration_rad_s2 * (1 + 1e-6)
    assert curve(move.turn_s) == pytest.approx(sense * angle * DEG, abs=1e-12)
    # Second order between corners: the jerk is zero.
    assert np.abs(curve(t[:-1], 3)).max() < 1e-6


@pytest.mark.parametrize(
    ("wanted", "message"),
    [
        (step("X", 90, 60), "X .90 deg at 60 deg/s, then dwell 10 s: inner: .*needs more than the limit of 30 deg/s.2"),
        (step("X", 2000, 48), "inner: 2000 deg is beyond the stop at 400 deg"),
        (step("X", 370, 10), "inner: 370 deg is beyond the 1 turns that the cable allows"),
        (step("X", 350, 49.5), "inner: .* is above the limit of 50 deg/s|needs more"),
        (step("X", 90, 0), "the rate must be above 0 deg/s"),
        (step("Q", 90, 10), "no axis or joint 'Q' .there are: X, Y, Z, outer, middle, inner"),
        (Step(None, 0.0), "nothing to do"),
        (Step(None, math.nan), "the dwell must be 0 s or longer"),
    ],
)
def test_a_step_beyond_the_table_is_refused_with_the_reason(wanted, message):
    with pytest.raises(DataError, match=message):
        plan_move(TABLE, np.zeros(3), wanted)


def test_steps_are_possible_only_one_after_the_other():
    cross, along = step("Z", 90, 10), step("Y", 90, 10)
    assert is_possible(TABLE, np.zeros(3), cross)
    assert is_possible(TABLE, np.zeros(3), along, cross)
    # Behind the first one no gimbal axis is along Y.
    assert not is_possible(TABLE, np.zeros(3), cross, along)
    # The cable allows one turn.
    half = step("X", 200, 10)
    assert is_possible(TABLE, np.zeros(3), half)
    assert not is_possible(TABLE, np.zeros(3), half, half)


def test_a_turn_is_made_by_the_joint_that_is_along_its_axis_now():
    assert plan_move(TABLE, np.zeros(3), step("Y", 90, 10)).joint == "outer"
    # The middle axis turned by half a turn: the outer axis points the other way in the platform.
    half = plan_move(TABLE, np.array([0.0, math.pi, 0.0]), step("Y", 90, 10))
    assert half.joint == "outer"
    assert half.target[0] == pytest.approx(-90 * DEG)
    with pytest.raises(DataError, match="no gimbal axis is along Y at outer 0, middle 90, inner 0 deg"):
        plan_move(TABLE, np.array([0.0, 0.5 * math.pi, 0.0]), step("Y", 90, 10))


def test_a_joint_can_be_named_and_a_step_can_only_dwell():
    assert plan_move(TABLE, np.ones(3), step("middle", 20, 5)).target[1] == pytest.approx(1.0 + 20 * DEG)
    still = plan_move(TABLE, np.ones(3), Step(None, 30.0))
    assert [p.time_s for p in still.waypoints] == [30.0]
    assert still.target == (1.0, 1.0, 1.0)


def test_the_joints_of_a_plan_are_chosen_so_that_the_cable_allows_every_turn():
    # Three half turns about X one way: the inner axis alone would need a turn and a half.
    turns = tuple(Turn("X", 180 * DEG, 10 * DEG) for _ in range(3))
    plan = Plan("wind", (5.0,) * 4, turns, 20 * DEG)
    with pytest.raises(DataError, match="within its limits"):
        moves_of(TABLE, np.zeros(3), plan)
    # With the middle axis at 90 deg the outer axis is along X as well, and takes a part.
    moves = moves_of(TABLE, np.array([0.0, 0.5 * math.pi, 0.0]), plan)
    assert {move.joint for move in moves} == {"", "outer", "inner"}
    assert max(abs(a) for move in moves for a in move.target) <= 2 * math.pi


def test_the_steps_of_a_plan_begin_with_its_first_dwell():
    plan = Plan("p", (1.0, 2.0), (Turn("X", 1.0, 0.1),), 0.5)
    first, second = steps_of(plan)
    assert (first.turn, first.dwell_s, second.dwell_s) == (None, 1.0, 2.0)
    assert second.acceleration_rad_s2 == 0.5
