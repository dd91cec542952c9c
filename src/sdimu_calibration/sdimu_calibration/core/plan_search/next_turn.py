"""The extra turn that separates effects which the plan so far cannot separate.

J is the information of plan and extra turn together on the parameters of the class, with everything else estimated too.
The part of parameter i that parameter j cannot replace has a significance of ``theta_i^2 (J_ii - J_ij^2 / J_jj)`` in
squares of sigma. The worst pair counts; the extra turn with the largest gain a minute comes first (T-optimality:
Atkinson & Fedorov, *Biometrika* 62 (1975)).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import permutations
from typing import cast

import numpy as np

from sdimu_calibration.core.effects import selection
from sdimu_calibration.core.effects.effect import Effect
from sdimu_calibration.core.plan import Plan, Turn
from sdimu_calibration.core.plan_search.bound import Bounds, Question, bounds
from sdimu_calibration.core.recording import DataError

RATES_RAD_S = (math.radians(2.0), math.radians(10.0))
"""Rates of extra turns (rad/s): that of the plan kim18, and a fast one for effects of higher order in the rate."""
_ANGLES_RAD = tuple(math.radians(a) for a in (90.0, -90.0, 180.0, -180.0))
"""Angles of extra turns (rad): both senses, ending on a cardinal direction."""
_NOTHING = 0.05
"""Significance (sigma) below which a turn tells nothing: it would be written as 0.0."""
_ACCELERATION_RAD_S2 = math.radians(20.0)
"""Least acceleration of extra turns (rad/s^2): half a second to the fastest rate."""


@dataclass(frozen=True)
class NextTurn:
    """An extra turn, or two there and back, at the end of a plan."""

    turns: tuple[Turn, ...]
    minutes: float
    """Turns and the stops after them."""
    before: float
    after: float
    """`before`, `after`: significance in sigma by which the least separable pair differs, without and with the extra
    turn."""

    @property
    def gain(self) -> float:
        """Gain in squared sigmas a minute."""
        return (self.after**2 - self.before**2) / self.minutes

    @property
    def text(self) -> str:
        """In words."""
        degrees = [(t.axis, math.degrees(t.angle_rad), math.degrees(t.rate_rad_s)) for t in self.turns]
        words = [f"{axis} {angle:+.0f} deg at {rate:g} deg/s" for axis, angle, rate in degrees]
        after, before = in_sigmas(self.after, self.before)
        changed = f"sigma instead of {before}" if after != before else "sigma with it and without: nothing changes"
        apart = f"apart by {after} {changed}"
        return f"turn {' and '.join(words)} ({self.minutes:.1f} min): {apart}"


def next_turn(
    plan: Plan,
    asked: Question,
    alike: Sequence[str | Effect],
    sizes: Mapping[str, float] | None = None,
    rates_rad_s: Sequence[float] = RATES_RAD_S,
    progress: Callable[[str, float], None] | None = None,
) -> tuple[NextTurn, ...]:
    """Rank the extra turns that separate effects.

    Parameters
    ----------
    plan : Plan
        The test so far.
    asked : Question
        With the model that is estimated in any case.
    alike : sequence of str or Effect
        The class: coefficients such as ``gyro_scale_asymmetry_y``, with options in brackets, or effects.
    sizes : mapping of str to float, optional
        Size (SI) of coefficients, such as the estimate; one sigma of the prior by default.
    rates_rad_s : sequence of float
        Rates the table can do.

    Returns
    -------
    tuple of NextTurn
        Best first: by gain a minute.
    """
    effects, names = named_class(alike)
    have = {p for name in asked.model.effects for p in _parameters(name)}
    more = [e for e in effects if not {p.name for p in e.parameters} <= have]
    # A model names its effects; `imu_model.build` takes an effect itself as well.
    model = replace(asked.model, effects=cast("tuple[str, ...]", (*asked.model.effects, *more)))
    with_class = replace(asked, model=model)
    # Fast turns need this acceleration; before and after are compared with one, which shapes the turns there are too.
    plan = replace(plan, acceleration_rad_s2=max(plan.acceleration_rad_s2, _ACCELERATION_RAD_S2))
    before = apart(bounds(plan, with_class), names, sizes)
    dwell = float(np.median(plan.dwell_s))
    extras = _extras(rates_rad_s)
    out = []
    for count, turns in enumerate(extras, start=1):
        longer = Plan(
            plan.name, (*plan.dwell_s, *(dwell for _ in turns)), (*plan.turns, *turns), plan.acceleration_rad_s2
        )
        after = apart(bounds(longer, with_class), names, sizes)
        minutes = (longer.duration_s - plan.duration_s) / 60.0
        out.append(NextTurn(turns, minutes, before, after))
        if progress is not None:
            progress("next turn", count / len(extras))
    return tuple(sorted(out, key=lambda one: -one.gain))


def named_class(alike: Sequence[str | Effect]) -> tuple[list[Effect], tuple[str, ...]]:
    """Find the effects that are to be told apart, and the names of their coefficients. `alike`: as for `next_turn`."""
    effects = [selection.resolve(e) for e in alike]
    names = tuple(p.name for e in effects for p in e.parameters)
    if len(names) < 2:
        raise DataError("nothing to tell apart: name two coefficients or more")
    if len(set(names)) < len(names):
        raise DataError(f"{next(n for n in names if names.count(n) > 1)}: named twice; name each coefficient once")
    return effects, names


def untold(ranked: Sequence[NextTurn], alike: Sequence[str | Effect]) -> str:
    """Say that no extra turn tells effects apart, and what would; empty where a turn does.

    A plan is foreseen at one temperature, so an effect of temperature has no part in what it foresees.

    `ranked`: every turn that was tried; `alike`: as for `next_turn`.
    """
    if max((one.after for one in ranked), default=0.0) >= _NOTHING:
        return ""
    effects = [selection.resolve(e) for e in alike]
    names = " and ".join(str(e) if isinstance(e, str) else e.name for e in alike)
    heat = any(e.needs == "temperature" for e in effects)
    why = ": a plan is foreseen at one temperature, and only a change of temperature tells them" if heat else ""
    return f"no turn tells {names} apart{why}"


def apart(told: Bounds, names: Sequence[str], sizes: Mapping[str, float] | None) -> float:
    """Significance in sigma by which the least separable pair of parameters differs.

    `names`: two coefficients or more; `sizes`: as for `next_turn`.
    """
    rows = [told.names.index(name) for name in names]
    prior = told.prior[rows]
    # In units of the priors, because coefficients of ppm and of rad/s share the matrix.
    covariance = told.covariance[np.ix_(rows, rows)] / np.outer(prior, prior)
    J = np.linalg.inv(covariance) - np.eye(len(rows))
    size = np.array([1.0 if sizes is None else sizes.get(n, p) / p for n, p in zip(names, prior, strict=True)])
    worst = min(
        size[i] ** 2 * (J[i, i] - (J[i, j] ** 2 / J[j, j] if J[j, j] > 0.0 else 0.0))
        for i, j in permutations(range(len(rows)), 2)
    )
    return float(np.sqrt(max(worst, 0.0)))


def in_sigmas(*values: float) -> list[str]:
    """Write significances in as many digits as show that they differ; in one where three do not.

    `*values`: in sigmas (1).
    """
    for digits in (1, 2, 3):
        out = [f"{value:.{digits}f}" for value in values]
        if len(set(out)) > 1:
            return out
    return [f"{value:.1f}" for value in values]


def _parameters(effect: str | Effect) -> tuple[str, ...]:
    return tuple(p.name for p in selection.resolve(effect).parameters)


def _extras(rates: Sequence[float]) -> list[tuple[Turn, ...]]:
    """Single turns about every axis, and half turns there and back."""
    singles = [(Turn(axis, angle, rate),) for axis in "XYZ" for angle in _ANGLES_RAD for rate in rates]
    fast = max(rates)
    pairs = [(Turn(axis, math.pi, fast), Turn(axis, -math.pi, fast)) for axis in "XYZ"]
    return [*singles, *pairs]
