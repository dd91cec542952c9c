"""Gimbals: exact rates with every imperfection, and the choice of the axis that makes a turn."""

import numpy as np
import pytest

from rate_table_sim.core.gimbal import gimbal_axes, gimbal_motion
from rate_table_sim.core.specification import Imperfections
from sdimu_calibration.core.plan import Plan, Turn
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.rotation import quaternion_matrix, skew
from sdimu_calibration.core.table.gimbals import assign_turns

ARCSEC = np.pi / 180 / 3600
BAD = Imperfections(400 * ARCSEC, -900 * ARCSEC, 200 * ARCSEC, -350 * ARCSEC, wobble_rad=600 * ARCSEC)


def plan_of(*turns):
    made = tuple(Turn(axis, np.radians(angle), 0.1) for axis, angle in turns)
    return Plan("test", (10.0,) * (len(made) + 1), made, 1.0)


def motion_at(t, axes=("Y", "Z", "X")):
    """Smooth motion of all three axes from a general attitude."""
    t = np.atleast_1d(t)
    angle = np.column_stack([0.4 + 0.7 * t, 1.1 - 0.5 * t**2, -0.8 + 0.3 * np.sin(t)])
    rate = np.column_stack([0.7 + 0 * t, -1.0 * t, 0.3 * np.cos(t)])
    frame = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    tilt = np.array([BAD.base_tilt_north_rad, BAD.base_tilt_east_rad, 0.0])
    return gimbal_motion(angle, rate, gimbal_axes(axes, BAD), tilt, BAD.wobble_rad, frame)


@pytest.mark.parametrize("axes", [("Y", "Z", "X"), ("Z", "Y", "X"), ("X", "Y", "X")])
def test_rate_is_the_derivative_of_the_orientation(axes):
    h, t = 1e-4, 0.9
    before, now, after = (quaternion_matrix(motion_at(t + s * h, axes)[0][0]) for s in (-1, 0, 1))
    omega = motion_at(t, axes)[1][0]
    # Central differences: the error is h^2/6 of the third derivative (about |omega|^3), and rounding over h.
    bound = 10 * (h**2 * np.linalg.norm(omega) ** 3 + 1e-16 / h)
    np.testing.assert_allclose(now.T @ (after - before) / (2 * h), skew(omega), rtol=0, atol=bound)


def test_nonorthogonality_is_the_angle_between_axes():
    axis = gimbal_axes(("Y", "Z", "X"), BAD)
    assert axis[0] @ axis[1] == pytest.approx(np.sin(BAD.outer_middle_nonorthogonality_rad), abs=1e-15)
    outer_right = gimbal_axes(("Y", "Z", "X"), Imperfections(middle_inner_nonorthogonality_rad=1e-3))
    assert outer_right[1] @ outer_right[2] == pytest.approx(np.sin(1e-3), abs=1e-15)


def test_wobble_moves_the_inner_axis_on_a_cone_once_a_turn():
    inner = np.linspace(0, 2 * np.pi, 9)
    angle = np.column_stack([0 * inner, 0 * inner, inner])
    frame = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    axis = gimbal_axes(("Y", "Z", "X"), Imperfections())
    q_nt, _ = gimbal_motion(angle, 0 * angle, axis, np.zeros(3), 1e-3, frame)
    points = np.array([quaternion_matrix(q)[:, 0] for q in q_nt])
    np.testing.assert_allclose(np.hypot(points[:, 1], points[:, 2]), np.sin(1e-3), rtol=1e-12)
    np.testing.assert_allclose(points[0], points[-1], atol=1e-15)
    np.testing.assert_allclose(points[0, 1:], -points[4, 1:], atol=1e-15)


def test_a_turn_without_parallel_gimbal_axis_is_refused_by_number_and_axis():
    with pytest.raises(DataError, match=r"turn 2 .*along Z.*axes: free"):
        assign_turns(plan_of(("X", 45), ("Z", 90)), ("Y", "Z", "X"))


def test_where_two_axes_could_turn_the_one_that_keeps_later_turns_possible_is_found():
    # After Z 90 outer and inner are both along X; only the outer leaves Z possible after 45 deg.
    chosen = assign_turns(plan_of(("Z", 90), ("X", 45), ("Z", 90)), ("Y", "Z", "X"))
    assert [axis for axis, _ in chosen] == [1, 0, 1]


def test_a_long_plan_with_a_dead_end_is_refused_and_not_searched_forever():
    plan = plan_of(("Z", 90), *[("X", 90)] * 40, ("X", 45), ("Y", 30), ("Z", 10))
    with pytest.raises(DataError, match="turn 44 "):
        assign_turns(plan, ("Y", "Z", "X"))
