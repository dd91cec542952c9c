"""The accelerometer triad turns as a whole against the gyro triad: with time, with temperature, under gravity.

A triad turned by small angles e about the body axes senses ``f - e x f``: df = -sum_i e_i (unit vector_i x f), one
angle on two accelerometers. Signs are those of a misalignment: +e about x is +q_yx and +q_zx.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.effects.effect import ACCEL, AXES, Effect, Excitation, Parameter, Term
from sdimu_calibration.core.effects.motion import Motion
from sdimu_calibration.core.effects.registry import register
from sdimu_calibration.core.units import to_si

_OVER_TIME = frozenset({Excitation.REPEATED_ATTITUDES})


def _turned(f: Floats, size: Floats, i: int) -> Floats:
    """``-size (unit vector_i x f)`` on the two accelerometers after i in the circle x, y, z; shape (n, 2), m/s^2."""
    return np.column_stack([size * f[:, (i + 2) % 3], -size * f[:, (i + 1) % 3]])


def _on_two(
    name: str, parts: tuple[str, ...], turn: tuple[int, ...], unit: tuple[str, str]
) -> tuple[tuple[Parameter, ...], tuple[Term, ...]]:
    """Parameters by suffix, and the two accelerometers that an angle about axis ``turn[k]`` changes."""
    parameters = tuple(Parameter(f"{name}_{part}", *unit) for part in parts)
    terms = tuple(Term(ACCEL[(i + n) % 3], k) for k, i in enumerate(turn) for n in (1, 2))
    return parameters, terms


def _prior(unit: str, navigation: float, tactical: float, mems: float) -> dict[str, float]:
    return {"navigation": to_si(navigation, unit), "tactical": to_si(tactical, unit), "mems": to_si(mems, unit)}


def _whole(
    name: str,
    title: str,
    equation: str,
    size: Callable[[Motion], Floats],
    unit: tuple[str, str],
    prior: tuple[float, float, float],
    **traits: Any,
) -> Effect:
    """One angle about each axis; `traits` are further ones of `Effect`."""
    parameters, terms = _on_two(name, tuple(AXES), (0, 1, 2), unit)
    return Effect(
        name=name,
        title=title,
        equation=equation,
        parameters=parameters,
        terms=terms,
        regressors=lambda m: np.hstack([_turned(m.f, size(m), i) for i in range(3)]),
        prior=_prior(unit[1], *prior),
        excitation=_OVER_TIME,
        **traits,
    )


RAMP = register(
    _whole(
        "accel_triad_ramp",
        "turn of the accelerometer triad with time",
        "df = -t sum_i k_i (e_i x f)",
        lambda m: m.t - 0.5 * m.dt,
        ("rad/s", "arcsec/h"),
        (5, 30, 300),
        typical="navigation 0.5-5, MEMS 10-300 arcsec/h",
        description="Glue and frame between the two triads that give way, most while the unit warms up. The gyros see "
        "no such turn, so the tilt of gravity against them drifts.",
        confused_with=("accel_triad_temperature", "gyro_bias_ramp", "accel_bias_ramp"),
        scope="power-on",
    )
)

TEMPERATURE = register(
    _whole(
        "accel_triad_temperature",
        "turn of the accelerometer triad with temperature",
        "df = -(T - T0) sum_i k_i (e_i x f)",
        lambda m: m.temperature,
        ("rad/K", "arcsec/degC"),
        (0.5, 3, 20),
        typical="navigation 0.05-0.5, MEMS 1-20 arcsec/C",
        description="The frame between the two triads expands unevenly. T0 is the temperature at the start.",
        confused_with=("accel_triad_ramp", "accel_bias_temperature"),
        scope="unit",
        needs="temperature",
    )
)

_PAIRS = tuple((i, j) for i in range(3) for j in range(3))
_FLEXURE = "accel_triad_flexure"
_FLEXURE_PARAMETERS, _FLEXURE_TERMS = _on_two(
    _FLEXURE, tuple(AXES[i] + AXES[j] for i, j in _PAIRS), tuple(i for i, _ in _PAIRS), ("rad/g", "arcsec/g")
)

FLEXURE = register(
    Effect(
        name=_FLEXURE,
        title="flexure between the triads under gravity",
        equation="df = -sum_ij k_ij a_j (e_i x f)",
        parameters=_FLEXURE_PARAMETERS,
        terms=_FLEXURE_TERMS,
        regressors=lambda m: np.hstack([_turned(m.f, m.a[:, j], i) for i, j in _PAIRS]),
        prior=_prior("arcsec/g", 2, 20, 200),
        excitation=frozenset({Excitation.OBLIQUE_STOPS}),
        typical="navigation 0.5-5, on isolators 5-60 arcsec/g",
        description="The mount between the triads bends about axis i under the force along axis j. Each coefficient "
        "is one cross term on one accelerometer and the same on another with the other sign or a square: kii a product "
        "on both, kij a coupling and a square. The sum kxx + kyy + kzz is an exact null, a x a = 0: it takes its value "
        "from the prior when all nine are added.",
        confused_with=("accel_cross_coupling", "accel_cross_square", "accel_cross_product"),
    )
)
