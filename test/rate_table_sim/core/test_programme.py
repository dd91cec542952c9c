"""A table that follows goals: it moves as a plan would, keeps its limits, and stands still in time without a goal."""

from __future__ import annotations

import numpy as np
import pytest

from rate_table_sim.core import TableMotion, TableSpecification, table_motion
from rate_table_sim.core.goal import Goal, GoalPoint
from rate_table_sim.core.programme import GoalProgramme
from sdimu_calibration.core.plan import Plan, Turn
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.table import AxisLimits, Move, RateTable, moves_of

DEG = np.pi / 180
LIMITS = AxisLimits(60 * DEG, 40 * DEG, cable_turns=1.5)
TABLE = TableSpecification(limits=(LIMITS, LIMITS, LIMITS))
DRIVEN = RateTable("ideal", TABLE.axes, TABLE.axis_names, TABLE.limits)
FREE = TableSpecification(axes=None)
TURNS = (Turn("Z", 90 * DEG, 10 * DEG), Turn("X", -180 * DEG, 20 * DEG), Turn("Z", -90 * DEG, 7 * DEG))
PLAN = Plan("short", (3.0, 4.0, 2.5, 5.0), TURNS, 30 * DEG)


def point(t: float, angle: list[float], rate: list[float] | None = None) -> GoalPoint:
    return GoalPoint(t, np.asarray(angle) * DEG, None if rate is None else np.asarray(rate) * DEG)


def goal_of(move: Move, name: str = "") -> Goal:
    return Goal(name, None, tuple(GoalPoint(p.time_s, np.array(p.angles), np.array(p.rates)) for p in move.waypoints))


def played(programme: GoalProgramme, size: int = 37) -> list[TableMotion]:
    blocks = []
    while count := min(size, programme.available):
        blocks.append(programme.block(count))
    return blocks


def column(blocks: list[TableMotion], name: str) -> np.ndarray:
    return np.concatenate([getattr(block, name) for block in blocks])


@pytest.mark.parametrize("table", [TABLE, FREE], ids=["gimbals", "free"])
def test_goals_of_a_plan_move_the_platform_as_the_plan_does(table):
    driven = RateTable("t", table.axes, table.axis_names, table.limits)
    programme = GoalProgramme(table, 1)
    blocks = played(programme)
    for move in moves_of(driven, np.zeros(3), PLAN):
        programme.take(goal_of(move))
        blocks += played(programme)
    direct = table_motion(PLAN, table, 1)
    # Each goal begins one sample after the one before has ended: two samples at rest for one of the plan.
    t = column(blocks, "t")
    np.testing.assert_allclose(np.diff(t), 0.01, atol=1e-9)
    ends = np.cumsum([0, 300, 900 + 400, 900 + 250]) + np.arange(4)
    keep = np.ones(len(t), dtype=bool)
    keep[ends] = False
    assert keep.sum() == len(direct.t)
    for name, tolerance in (("angle", 1e-13), ("rate", 1e-12), ("q_nt", 1e-13), ("omega_nt_t", 1e-12)):
        np.testing.assert_allclose(column(blocks, name)[keep], getattr(direct, name), atol=tolerance, rtol=0)
    np.testing.assert_array_equal(column(blocks, "dwell")[keep], direct.dwell)
    np.testing.assert_array_equal(column(blocks, "stop")[keep], direct.stop)


def test_a_table_without_a_goal_has_one_sample_and_then_none():
    programme = GoalProgramme(TABLE, 1)
    assert len(column(played(programme), "t")) == 1
    assert programme.available == 0
    assert not programme.over


def test_points_without_velocities_are_turned_to_from_rest_to_rest_within_the_limits():
    programme = GoalProgramme(TABLE, 1)
    points = (point(5.0, [0, 90, 0]), point(9.0, [0, 90, 0]), point(12.0, [10, 90, -20]))
    programme.take(Goal("", None, points))
    blocks = played(programme)
    rate = column(blocks, "rate")
    assert np.abs(np.diff(rate, axis=0)).max() / 0.01 <= 40 * DEG * (1 + 1e-9)
    np.testing.assert_allclose(column(blocks, "angle")[-1] / DEG, [10, 90, -20], atol=1e-12)
    assert not rate[-1].any()
    np.testing.assert_array_equal(np.unique(column(blocks, "stop")), [0, 1, 2])


@pytest.mark.parametrize(
    ("points", "message"),
    [
        ([point(0.5, [0, 90, 0])], r"middle: 90 deg about middle at a mean of 180 deg/s needs .* 40 deg/s\^2"),
        ([point(2.0, [0, 100, 0], [0, 0, 0])], r"middle: 150 deg/s\^2 is above the limit of 40 deg/s\^2"),
        ([point(30.0, [0, 0, 600])], r"inner: 600 deg at 30 s is beyond the 1.5 turns that the cable allows"),
        (
            [
                point(2.0, [65, 0, 0], [65, 0, 0]),
                point(8.0, [400, 0, 0], [65, 0, 0]),
                point(12.0, [500, 0, 0], [0, 0, 0]),
            ],
            r"outer: 65 deg/s at 2 s is above the limit of 60 deg/s",
        ),
        ([point(3.0, [0, 1, 0]), point(3.0, [0, 2, 0])], "time_from_start does not ascend strictly"),
        ([point(3.0, [0, 10, 0], [0, 5, 0])], r"the last point has a velocity of 5 deg/s \(expected 0\)"),
        ([point(3.0, [0, np.nan, 0])], "not finite"),
        ([point(0.0, [0, 5, 0]), point(3.0, [0, 5, 0])], "the point at 0 s is 5 deg from where middle is"),
        ([point(1e9, [0, 5, 0])], "time_from_start"),
        ([point(-1.0, [0, 5, 0])], "time_from_start"),
    ],
)
def test_a_goal_that_cannot_be_is_refused_with_the_reason_and_changes_nothing(points, message):
    programme = GoalProgramme(TABLE, 1)
    played(programme)
    with pytest.raises(DataError, match=message) as caught:
        programme.take(Goal("", None, tuple(points)))
    assert "\n" not in str(caught.value)
    assert programme.available == 0
    assert programme.goal is None


def test_a_free_table_refuses_two_axes_at_once():
    programme = GoalProgramme(FREE, 1)
    with pytest.raises(DataError, match="one axis at a time"):
        programme.take(Goal("", None, (point(5.0, [10, 10, 0]),)))


def test_a_new_goal_replaces_the_old_one_without_a_jump():
    programme = GoalProgramme(TABLE, 1)
    programme.take(Goal("old", None, (point(9.0, [0, 90, 0]),)))
    blocks = [programme.block(400)]
    assert programme.take(Goal("new", None, (point(10.0, [0, 0, 0], [0, 0, 0]),))).name == "old"
    blocks += played(programme)
    angle, rate = column(blocks, "angle"), column(blocks, "rate")
    np.testing.assert_allclose(np.diff(angle, axis=0), 0.005 * (rate[1:] + rate[:-1]), atol=40 * DEG * 1e-4)
    assert np.abs(np.diff(rate, axis=0)).max() / 0.01 <= 40 * DEG * (1 + 1e-9)
    np.testing.assert_allclose(angle[-1], 0.0, atol=1e-15)


def test_a_goal_with_a_start_in_the_future_waits_for_it():
    programme = GoalProgramme(TABLE, 1)
    played(programme)
    programme.take(Goal("", 2.0, (point(5.0, [0, 20, 0]),)))
    blocks = played(programme)
    t, moving = column(blocks, "t"), ~column(blocks, "dwell")
    assert t[moving][0] == pytest.approx(2.0)
    assert t[-1] == pytest.approx(7.0)


def test_what_is_left_of_a_goal_that_began_in_the_past_is_played_and_nothing_if_it_is_over():
    programme = GoalProgramme(TABLE, 1)
    programme.take(Goal("", None, (point(3.0, [0, 0, 0]),)))
    played(programme)
    with pytest.raises(DataError, match=r"ends 1\.01 s in the past"):
        programme.take(Goal("", 1.0, (point(1.0, [0, 20, 0]),)))
    programme.take(Goal("", 1.0, (point(1.0, [0, 0, 0]), point(6.0, [0, 20, 0]))))
    blocks = played(programme)
    assert column(blocks, "t")[-1] == pytest.approx(7.0)
    np.testing.assert_allclose(column(blocks, "angle")[-1, 1], 20 * DEG)


def test_hold_brakes_within_the_limits_and_resume_reaches_the_target_with_its_dwell():
    programme = GoalProgramme(TABLE, 1)
    (first, move, *_) = moves_of(DRIVEN, np.zeros(3), PLAN)
    programme.take(goal_of(first))
    played(programme)
    programme.take(goal_of(move, "turn"))
    blocks = [programme.block(500)]
    assert programme.hold()
    blocks += played(programme)
    assert not column(blocks, "rate")[-1].any()
    assert programme.available == 0
    assert programme.reached() is None
    held = column(blocks, "angle")[-1, 1]
    assert 0.3 * 90 * DEG < held < 0.9 * 90 * DEG
    assert programme.resume().name == "turn"
    blocks += played(programme)
    rate, angle = column(blocks, "rate"), column(blocks, "angle")
    assert np.abs(np.diff(rate, axis=0)).max() / 0.01 <= 40 * DEG * (1 + 1e-9)
    assert np.abs(rate).max() <= np.abs([p.rates for p in move.waypoints]).max() * (1 + 1e-9)
    np.testing.assert_allclose(angle[-1], move.target, atol=1e-14)
    at_target = np.flatnonzero(np.all(angle == angle[-1], axis=1))
    assert len(at_target) - 1 >= 400
    assert programme.reached().name == "turn"


def test_stop_forgets_the_goal_and_takes_no_other_until_resume():
    programme = GoalProgramme(TABLE, 1)
    programme.take(Goal("turn", None, (point(9.0, [0, 90, 0]),)))
    programme.block(300)
    assert programme.stop().name == "turn"
    played(programme)
    with pytest.raises(DataError, match="stopped: call the service resume first"):
        programme.take(Goal("", None, (point(9.0, [0, 0, 0]),)))
    assert programme.resume() is None
    programme.take(Goal("", None, (point(9.0, [0, 0, 0]),)))


def test_the_motion_does_not_depend_on_the_blocks_in_which_it_is_taken():
    angles = []
    for size in (7, 50, 100000):
        programme = GoalProgramme(TableSpecification(), 3)
        programme.take(Goal("", None, (point(4.0, [10, 0, 0]), point(6.0, [10, 0, 0]), point(9.0, [10, 0, 30]))))
        blocks = played(programme, size)
        angles.append([column(blocks, name) for name in ("t", "encoder_angle", "dwell", "stop", "q_nt")])
    for others in angles[1:]:
        for one, other in zip(angles[0], others, strict=True):
            np.testing.assert_array_equal(one, other)
