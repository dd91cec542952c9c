"""Which gimbal axis makes a turn about an axis of the platform."""

from __future__ import annotations

import math

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.plan import Plan
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.rotation import rotation_matrix
from sdimu_calibration.core.table.description import AXES
from sdimu_calibration.core.wording import Option

PARALLEL_RAD = 1e-9
"""Largest angle (rad) between a gimbal axis and the platform axis it turns about: rounding of stated angles."""


def unit(letter: str) -> Floats:
    """Return the unit vector of an axis letter, a direction (1), shape (3,)."""
    vector = np.zeros(3)
    vector[AXES.index(letter)] = 1.0
    return vector


def axes_along(
    letter: str, angles: Floats, axes: tuple[str, str, str], tolerance_rad: float = PARALLEL_RAD
) -> list[tuple[int, float]]:
    """Gimbal axes that are along an axis of the platform, with sense; the innermost is last.

    Parameters
    ----------
    angles : ndarray, shape (3,)
        Of outer, middle and inner axis (rad).
    axes : tuple of str
        Axis letters of outer, middle and inner axis at zero angles.
    tolerance_rad : float
        How far from parallel still counts (rad).

    Returns
    -------
    list of (int, float)
        Gimbal axis (0 outer, 1 middle, 2 inner) and +1 or -1.
    """
    wanted = unit(letter)
    outer, middle, inner = (unit(a) for a in axes)
    C_inner = rotation_matrix(angles[2] * inner)
    C_middle = rotation_matrix(angles[1] * middle)
    along = (C_inner.T @ (C_middle.T @ outer), C_inner.T @ middle, inner)
    return [
        (k, float(np.sign(axis @ wanted)))
        for k, axis in enumerate(along)
        if np.linalg.norm(np.cross(axis, wanted)) < max(tolerance_rad, PARALLEL_RAD)
    ]


def assign_turns(
    plan: Plan,
    axes: tuple[str, str, str],
    start: Floats | None = None,
    reach_rad: tuple[float, float, float] = (math.inf, math.inf, math.inf),
    tolerance_rad: float = PARALLEL_RAD,
) -> tuple[tuple[int, float], ...]:
    """Which gimbal axis makes each turn, and in which sense.

    A turn about a platform axis is a turn of one gimbal axis only while that axis is parallel or antiparallel
    to it. Where two are, the choice decides what is possible later, so the choices are searched.

    Parameters
    ----------
    axes : tuple of str
        Axis letters of outer, middle and inner axis at zero angles.
    start : ndarray, shape (3,), optional
        Angles at the start (rad); zero when left out.
    reach_rad : tuple of float
        Largest angle of each axis either way (rad).
    tolerance_rad : float
        How far from parallel still counts (rad): encoders read a start that is nearly zero.

    Returns
    -------
    tuple of (int, float)
        Gimbal axis (0 outer, 1 middle, 2 inner) and sign, one per turn.
    """
    bounded = any(map(math.isfinite, reach_rad))
    dead_ends: set[tuple[int, tuple[float, ...]]] = set()
    furthest = 0
    choice: list[tuple[int, float]] = []
    angles = [np.zeros(3) if start is None else np.asarray(start, dtype=np.float64)]
    untried = [_choices(plan, 0, angles[0], axes, tolerance_rad)]
    while len(choice) < len(plan.turns):
        number = len(choice)
        furthest = max(furthest, number)
        if not untried[-1]:
            dead_ends.add((number, _state(angles[-1], bounded)))
            if not choice:
                turn = plan.turns[furthest]
                raise DataError(
                    f"turn {furthest + 1} of plan {plan.name}: no gimbal axis is along {turn.axis} there "
                    f"{'within its limits ' if bounded else ''}"
                    f"(the table turns {', '.join(axes)}; use {Option.TABLE} free, or axes: free in the table's file)"
                )
            untried.pop()
            angles.pop()
            choice.pop()
            continue
        k, sign = untried[-1].pop()
        after = angles[-1].copy()
        after[k] += sign * plan.turns[number].angle_rad
        if abs(after[k]) > reach_rad[k] + PARALLEL_RAD or (number + 1, _state(after, bounded)) in dead_ends:
            continue
        choice.append((k, sign))
        angles.append(after)
        untried.append(_choices(plan, number + 1, after, axes, tolerance_rad))
    return tuple(choice)


def _choices(
    plan: Plan, number: int, angles: Floats, axes: tuple[str, str, str], tolerance_rad: float
) -> list[tuple[int, float]]:
    return axes_along(plan.turns[number].axis, angles, axes, tolerance_rad) if number < len(plan.turns) else []


def _state(angles: Floats, bounded: bool) -> tuple[float, ...]:
    # Angles a full turn apart give the same directions, but not the same way to the end of a cable.
    seen = angles if bounded else np.concatenate([np.cos(angles), np.sin(angles)])
    return tuple(np.round(seen, 6) + 0.0)
