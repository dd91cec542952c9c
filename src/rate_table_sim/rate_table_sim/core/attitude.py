"""Orientation of the platform from the axes, stretch by stretch."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from rate_table_sim.core.gimbal import gimbal_axes, gimbal_motion, quaternion_product, turn_quaternion
from rate_table_sim.core.specification import Imperfections, TableSpecification
from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.table.gimbals import unit


class Attitude(Protocol):
    """Makes orientations from angles."""

    def motion(self, angle: Floats, rate: Floats, before: Floats, q_before: Floats) -> tuple[Floats, Floats]:
        """Orientation (n, 4) and rate (n, 3) at samples that follow one with the angles and orientation `before`."""


def attitude_of(table: TableSpecification) -> Attitude:
    """Return what makes orientations of a table; DataError when its imperfections are of gimbals it has not."""
    if table.axes is None:
        refuse_gimbal_errors(table.imperfections)
        return _Free()
    return _Gimbals(table.axes, table.imperfections)


def first_orientation(table: TableSpecification) -> Floats:
    """Return the orientation at zero angles, a quaternion of shape (4,)."""
    if table.axes is None:
        return np.asarray(turn_quaternion(base_tilt(table.imperfections)))
    zero = np.zeros((1, 3))
    return np.asarray(attitude_of(table).motion(zero, zero, np.zeros(3), np.zeros(4))[0][0])


def base_tilt(errors: Imperfections) -> Floats:
    """Return the rotation vector of the base, shape (3,) (rad)."""
    return np.array([errors.base_tilt_north_rad, errors.base_tilt_east_rad, 0.0])


def refuse_gimbal_errors(errors: Imperfections) -> None:
    """Raise DataError for errors of gimbals on a table without gimbals."""
    gimbal_errors = (
        errors.outer_middle_nonorthogonality_rad,
        errors.middle_inner_nonorthogonality_rad,
        errors.wobble_rad,
    )
    if any(gimbal_errors):
        raise DataError("a table with axes: free has no gimbals: set non-orthogonality and wobble to 0")


class _Gimbals:
    """Three axes: the orientation depends on the angles alone."""

    def __init__(self, axes: tuple[str, str, str], errors: Imperfections) -> None:
        self._axis = gimbal_axes(axes, errors)
        p = np.cross(unit(axes[1]), self._axis[2])
        p /= np.linalg.norm(p)
        self._frame = np.array([p, np.cross(self._axis[2], p)])
        self._tilt, self._wobble = base_tilt(errors), errors.wobble_rad

    def motion(self, angle: Floats, rate: Floats, _before: Floats, _q_before: Floats) -> tuple[Floats, Floats]:
        return gimbal_motion(angle, rate, self._axis, self._tilt, self._wobble, self._frame)


class _Free:
    """No gimbals: turns about platform axes, one after the other."""

    def motion(self, angle: Floats, rate: Floats, before: Floats, q_before: Floats) -> tuple[Floats, Floats]:
        n = len(angle)
        moved = np.diff(np.vstack([before, angle]), axis=0) != 0.0
        if (moved.sum(axis=1) > 1).any():
            raise DataError("a table without gimbals turns about one axis at a time")
        q_nt = np.empty((n, 4))
        column = np.where(moved.any(axis=1), moved.argmax(axis=1), -1)
        starts = np.flatnonzero(np.r_[True, np.diff(column) != 0])
        q, at = q_before, before
        for first, stop in zip(starts, [*starts[1:], n], strict=True):
            k = int(column[first])
            turned = angle[first:stop, k] - at[k] if k >= 0 else np.zeros(stop - first)
            about = quaternion_product(q, np.eye(4)[1 + max(k, 0)])
            # q (cos + e sin) = q cos + (q e) sin: one product per turn.
            q_nt[first:stop] = np.outer(np.cos(0.5 * turned), q) + np.outer(np.sin(0.5 * turned), about)
            q, at = q_nt[stop - 1], angle[stop - 1]
        return q_nt, rate.copy()
