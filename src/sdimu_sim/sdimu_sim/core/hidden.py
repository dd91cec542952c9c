"""Hidden effects: what a test can put into the truth that the baseline model does not have.

An effect is given as ``NAME=VALUE``: ``accel_quadratic_x=20 ug/g^2``; parameters follow after semicolons:
``gyro_bias_warm_up_x=0.3 deg/h; tau=1200 s``. A name of a sensor (``gyro_x`` ... ``accel_z``) takes a formula in
rad/s or m/s^2: ``accel_z=20*ug*ax*wz``.

Each row of the table is a formula in the TRUE sample means, written here from the physics and not from the
calibrator's regressors. Index letters: {i} the sensor's own axis, {j} and {k} the others.
"""

from __future__ import annotations

import difflib
import itertools
import math
from collections.abc import Iterable
from dataclasses import dataclass

from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.units import STANDARD_GRAVITY, UnitError, parse_quantity
from sdimu_sim.core.expression import Expression, parse_expression

_XYZ = "xyz"
SENSORS: tuple[str, ...] = tuple(f"{triad}_{own}" for triad in ("gyro", "accel") for own in _XYZ)
"""The six sensors, in the order of every array of six."""

VARIABLES: tuple[str, ...] = (
    *(f"{v}{i}" for v in ("w", "a", "alpha", "wt", "B", "turned", "leant") for i in _XYZ),
    *(f"L{i}{j}" for i in _XYZ for j in _XYZ),
    "t",
    "T",
    "dT",
    "dTdt",
    "moving",
    "since",
)
"""True means over the sample: body rate w (rad/s), specific force a (f/g), angular acceleration alpha (rad/s^2),
rate of the table wt (rad/s), magnetic field B (T), lever-arm tensor L (1/s^2), sign of the last turn about and of
the last change of a along an axis (turned, leant), time t (s), temperature T (deg C), its change since the start dT
(K) and rate dTdt (K/s), moving (1 while the table turns), time since the last turn ended (since; s, 0 in turns, very
long before the first)."""

CONSTANTS: dict[str, float] = {
    "g": STANDARD_GRAVITY,
    "ug": 1e-6 * STANDARD_GRAVITY,
    "mg": 1e-3 * STANDARD_GRAVITY,
    "deg": math.pi / 180.0,
    "h": 3600.0,
    "ppm": 1e-6,
    "pi": math.pi,
}

TEMPERATURE_NAMES = frozenset({"T", "dT", "dTdt"})


@dataclass(frozen=True)
class _Row:
    """Family of effects: names, unit of k, formula; `parameters` as (name, unit)."""

    names: str
    unit: str
    formula: str
    parameters: tuple[tuple[str, str], ...] = ()


_BOTH = (("gyro", "deg/h", "w{i}"), ("accel", "ug", "g*a{i}"))

_ROWS: tuple[_Row, ...] = (
    _Row("accel_quadratic_{i}", "ug/g^2", "k*a{i}**2"),
    _Row("accel_cubic_{i}", "ug/g^3", "k*a{i}**3"),
    _Row("accel_odd_quadratic_{i}", "ug/g^2", "k*a{i}*abs(a{i})"),
    _Row("accel_scale_asymmetry_{i}", "ppm", "k*g*abs(a{i})"),
    _Row("accel_bias_asymmetry_{i}", "ug", "k*sign(a{i})"),
    _Row("accel_cross_coupling_{i}{j}", "ug/g^2", "k*a{i}*a{j}"),
    _Row("accel_cross_square_{i}{j}", "ug/g^2", "k*a{j}**2"),
    _Row("accel_cross_product_{i}", "ug/g^2", "k*a{o}*a{p}"),
    _Row("accel_size_{i}{any}", "mm", "k*L{i}{any}"),
    _Row("accel_hysteresis_{i}", "ug", "k*leant{i}"),
    _Row("accel_magnetic_{i}{any}", "ug/G", "k*B{any}"),
    _Row("gyro_g_sensitivity_{i}{any}", "deg/h/g", "k*a{any}"),
    _Row("gyro_g_squared_{i}{any}", "deg/h/g^2", "k*a{any}**2"),
    _Row("gyro_g_product_{i}{pair}", "deg/h/g^2", "k*a{pair[0]}*a{pair[1]}"),
    _Row("gyro_g_dependent_scale_{i}", "ppm/g", "k*a{i}*w{i}"),
    _Row("gyro_scale_asymmetry_{i}", "ppm", "k*abs(w{i})"),
    _Row("gyro_scale_quadratic_{i}", "ppm*s/deg", "k*w{i}**2"),
    _Row("gyro_scale_cubic_{i}", "ppm*s^2/deg^2", "k*w{i}**3"),
    _Row("gyro_misalignment_asymmetry_{i}{j}", "arcsec", "k*abs(w{j})"),
    _Row("gyro_anisoinertia_{i}", "s/rad", "k*w{o}*w{p}"),
    _Row("gyro_acceleration_sensitivity_{i}{any}", "s", "k*alpha{any}"),
    _Row("gyro_dead_band_{i}", "deg/h", "-min(max(w{i}, -k), k)"),
    _Row("gyro_hysteresis_{i}", "deg/h", "k*turned{i}"),
    _Row("gyro_magnetic_{i}{any}", "deg/h/G", "k*B{any}"),
    *(
        row
        for triad, unit, signal in _BOTH
        for row in (
            _Row(f"{triad}_bias_temperature_{{i}}", f"{unit}/degC", "k*dT"),
            _Row(f"{triad}_bias_temperature_rate_{{i}}", f"{unit}*s/degC", "k*dTdt"),
            _Row(f"{triad}_bias_warm_up_{{i}}", unit, "k*exp(-t/tau)", (("tau", "s"),)),
            _Row(f"{triad}_bias_ramp_{{i}}", f"{unit}/h", "k*t"),
            _Row(f"{triad}_bias_step_{{i}}", unit, "k*(1 + sign(t - t0))/2", (("t0", "s"),)),
            _Row(f"{triad}_bias_in_motion_{{i}}", unit, "k*moving"),
            _Row(f"{triad}_bias_settling_{{i}}", unit, "k*(1 - moving)*exp(-since/tau)", (("tau", "s"),)),
            _Row(f"{triad}_scale_temperature_{{i}}", "ppm/degC", f"k*dT*{signal}"),
            _Row(f"{triad}_scale_ramp_{{i}}", "ppm/h", f"k*t*{signal}"),
        )
    ),
)


def _expand(row: _Row) -> Iterable[tuple[str, tuple[str, _Row]]]:
    """Every name of a family, with its sensor and its formula filled in."""
    triad = row.names.split("_", 1)[0]
    for i in _XYZ:
        o, p = (a for a in _XYZ if a != i)
        for j, whichever, pair in itertools.product(o + p, _XYZ, ("xy", "xz", "yz")):
            letters = {"i": i, "j": j, "o": o, "p": p, "any": whichever, "pair": pair}
            filled = _Row(row.names, row.unit, row.formula.format(**letters), row.parameters)
            yield row.names.format(**letters), (f"{triad}_{i}", filled)


_TABLE: dict[str, tuple[str, _Row]] = {name: entry for row in _ROWS for name, entry in _expand(row)}

_DELAYS: dict[str, tuple[str, ...]] = {
    **{f"{triad}_delay": tuple(s for s in SENSORS if s.startswith(triad)) for triad in ("gyro", "accel")},
    **{f"{sensor[:-2]}_delay_{sensor[-1]}": (sensor,) for sensor in SENSORS},
}
_LOST = "gyro_lost_data"
LOST_AFTER_S = 3.0
"""Data of a turn are lost from this long after its start."""


@dataclass(frozen=True)
class Term:
    """Something added to one sensor's output.

    Attributes
    ----------
    name : str
        Of the effect.
    sensor : int
        Index in `SENSORS`.
    expression : Expression
        rad/s or m/s^2.
    parameters : mapping of str to float
        k and others, SI; constants for the expression.
    """

    name: str
    sensor: int
    expression: Expression
    parameters: dict[str, float]


@dataclass(frozen=True)
class Hidden:
    """All hidden effects of a test.

    Attributes
    ----------
    terms : tuple of Term
    delay_s : tuple of float
        Of each of the six sensors (>= 0).
    lost : tuple of (int, float)
        Turn (from 1) and length (s) of gyro data lost in it.
    """

    terms: tuple[Term, ...] = ()
    delay_s: tuple[float, ...] = (0.0,) * 6
    lost: tuple[tuple[int, float], ...] = ()

    @property
    def needs_temperature(self) -> bool:
        """Whether any term reads the temperature."""
        return any(term.expression.names & TEMPERATURE_NAMES for term in self.terms)


def effect_names() -> tuple[str, ...]:
    """Names that `parse_effects` takes, without the six sensors."""
    return (*sorted(_TABLE), *sorted(_DELAYS), _LOST)


def effect_example(name: str) -> str:
    """Return a ``NAME=VALUE`` that is read, with the unit people use; `name` is one of `effect_names`."""
    if name in _DELAYS:
        return f"{name}=1 ms"
    if name == _LOST:
        return f"{name}=10 ms; turn=1"
    _, row = _TABLE[name]
    return f"{name}=1 {row.unit}" + "".join(f"; {key}=100 {unit}" for key, unit in row.parameters)


def parse_effects(texts: Iterable[str]) -> Hidden:
    """Read hidden effects.

    Parameters
    ----------
    texts : iterable of str
        ``NAME=VALUE`` each.

    Raises
    ------
    DataError
        Names the effect and says what was expected.
    """
    terms: list[Term] = []
    delay = dict.fromkeys(SENSORS, 0.0)
    lost: list[tuple[int, float]] = []
    for text in texts:
        name, equals, value = (part.strip() for part in text.partition("="))
        if not equals or not value:
            raise DataError(f"effect '{text}': expected NAME=VALUE, such as accel_quadratic_x='20 ug/g^2'")
        if name in SENSORS:
            terms.append(Term(name, SENSORS.index(name), parse_expression(value, (*VARIABLES, *CONSTANTS)), {}))
        elif name in _DELAYS:
            (seconds,) = _values(name, value, (("k", "ms"),)).values()
            if seconds < 0.0:
                raise DataError(f"effect {name}: a delay is not negative (delay the other triad instead)")
            for sensor in _DELAYS[name]:
                delay[sensor] += seconds
        elif name == _LOST:
            values = _values(name, value, (("k", "ms"), ("turn", "1")))
            if values["turn"] < 1 or values["turn"] % 1 or values["k"] <= 0.0:
                raise DataError(f"effect {name}: expected something like '10 ms; turn=7' (turns count from 1)")
            lost.append((int(values["turn"]), values["k"]))
        elif name in _TABLE:
            terms.append(_named_term(name, value))
        else:
            raise DataError(f"unknown effect '{name}'{_suggestion(name)}")
    return Hidden(tuple(terms), tuple(delay[s] for s in SENSORS), tuple(lost))


def _named_term(name: str, value: str) -> Term:
    sensor, row = _TABLE[name]
    values = _values(name, value, (("k", row.unit), *row.parameters))
    if values.get("tau", 1.0) <= 0.0:
        raise DataError(f"effect {name}: tau must be positive")
    known = (*VARIABLES, *CONSTANTS, *values)
    return Term(name, SENSORS.index(sensor), parse_expression(row.formula, known), values)


def _values(name: str, text: str, wanted: tuple[tuple[str, str], ...]) -> dict[str, float]:
    """Read ``VALUE; name=VALUE ...``: the size k first, then exactly the wanted parameters."""
    first, *rest = (part.strip() for part in text.split(";"))
    given = {"k": first} | {key.strip(): value.strip() for key, _, value in (part.partition("=") for part in rest)}
    example = "; ".join(f"1 {unit}" if key == "k" else f"{key}=1 {unit}" for key, unit in wanted)
    if set(given) != {key for key, _ in wanted}:
        raise DataError(f"effect {name}: cannot read '{text}' (expected something like '{example}')")
    try:
        return {key: parse_quantity(given[key], unit) for key, unit in wanted}
    except UnitError as error:
        raise DataError(f"effect {name}: {error}") from error


def _suggestion(name: str) -> str:
    close = difflib.get_close_matches(name, effect_names(), n=3)
    return f" (did you mean {', '.join(close)}?)" if close else f" (known: {', '.join(effect_names()[:6])}, ...)"
