"""Hidden effects: what a test can put into the truth that a model does not have, or has.

An effect is given by its canonical key with a size (`sdimu_calibration.core.effect_key`):
``accel_quadratic_x=20 ug/g^2``, ``gyro_bias_warm_up_x(tau=1200 s)=0.3 deg/h``, ``gyro_x: ey^2=0.1 deg/h``. A
coefficient of the baseline takes this value instead of a drawn one. A sensor (``gyro_x`` ... ``accel_z``) takes a
formula in rad/s or m/s^2: ``accel_z=20*ug*ax*wz``.

Each row of the table is a formula in the TRUE sample means, written here from the physics and not from the
calibrator's regressors. Index letters: {i} the sensor's own axis, {j} and {k} the others.
"""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from importlib.metadata import entry_points
from typing import NamedTuple

from sdimu_calibration.core.effect_key import SENSORS, EffectKey, parse_key, read_options, read_quantity
from sdimu_calibration.core.recording import DataError
from sdimu_sim.core.equation import CONSTANTS, read_equation
from sdimu_sim.core.expression import Expression, parse_expression
from sdimu_sim.core.hidden_row import Entry, Part, Row, expand
from sdimu_sim.core.truth import COEFFICIENT_UNITS

_XYZ = "xyz"

VARIABLES: tuple[str, ...] = (
    *(f"{v}{i}" for v in ("w", "a", "f", "alpha", "wt", "n", "e", "d", "B", "turned", "leant") for i in _XYZ),
    *(f"L{i}{j}" for i in _XYZ for j in _XYZ),
    "t",
    "T",
    "dT",
    "dTdt",
    "slow",
    "moving",
    "since",
    *(f"wound{i}" for i in _XYZ),
)
"""True means over the sample: body rate w (rad/s), specific force a (f/g) and f (m/s^2), angular acceleration alpha
(rad/s^2), rate of the table wt (rad/s), North, East and Down component of a body axis (n, e, d), magnetic field B (T),
lever-arm tensor L (1/s^2), sign of the last turn about and of the last change of a along an axis (turned, leant), time
t (s), temperature of the sensors T (deg C), T - T0 as dT (K), rate dTdt and its mean over a minute slow (K/s), moving
(1 while the table turns), time since the last turn ended (since; s, 0 in turns, very long before the first), angle
turned since the start about a body axis (wound; rad)."""
DIRECTIONS = frozenset(f"{v}{i}" for v in "ne" for i in _XYZ)
"""Variables that cost the generator a pass of their own."""

TEMPERATURE_NAMES = frozenset({"T", "dT", "dTdt", "slow"})
_BOTH = (("gyro", "deg/h", "w{i}"), ("accel", "ug", "g*a{i}"))


def _by_temperature(word: str, per: str, power: str) -> list[Row]:
    """Rows of one power of the temperature: bias, scale factor, mass unbalance, and the axes that turn.

    An axis i that turns about the next one (n) moves away from the one before (m); about that one it moves towards n.
    """
    rows = [
        Row(f"gyro_mass_unbalance_{word}_{kind}{{i}}", f"deg/h/g/{per}", f"k*{power}*a{{{kind}}}", drawn=False)
        for kind in "dq"
    ]
    for triad, unit, signal in _BOTH:
        vector = signal.replace("{i}", "")
        rows += [
            Row(f"{triad}_bias_{word}_{{i}}", f"{unit}/{per}", f"k*{power}", drawn=power == "dT"),
            Row(f"{triad}_scale_{word}_{{i}}", f"ppm/{per}", f"k*{power}*{signal}", drawn=power == "dT"),
            Row(f"{triad}_misalignment_{word}_{{i}}{{n}}", f"arcsec/{per}", f"-k*{power}*{vector}{{m}}", drawn=False),
            Row(f"{triad}_misalignment_{word}_{{i}}{{m}}", f"arcsec/{per}", f"k*{power}*{vector}{{n}}", drawn=False),
        ]
    return rows


_ROWS: tuple[Row, ...] = (
    Row("accel_quadratic_{i}", "ug/g^2", "k*a{i}**2"),
    Row("accel_cubic_{i}", "ug/g^3", "k*a{i}**3"),
    Row("accel_odd_quadratic_{i}", "ug/g^2", "k*a{i}*abs(a{i})"),
    Row("accel_scale_asymmetry_{i}", "ppm", "k*g*abs(a{i})"),
    Row("accel_bias_asymmetry_{i}", "ug", "k*sign(a{i})"),
    Row("accel_cross_coupling_{i}{j}", "ug/g^2", "k*a{i}*a{j}"),
    Row("accel_cross_square_{i}{j}", "ug/g^2", "k*a{j}**2"),
    Row("accel_cross_product_{i}", "ug/g^2", "k*a{o}*a{p}"),
    Row("accel_size_{i}{any}", "mm", "k*L{i}{any}"),
    Row("accel_hysteresis_{i}", "ug", "k*leant{i}"),
    Row("accel_magnetic_{i}{any}", "ug/G", "k*B{any}"),
    Row("gyro_g_sensitivity_{i}{any}", "deg/h/g", "k*a{any}"),
    Row("gyro_g_squared_{i}{any}", "deg/h/g^2", "k*a{any}**2"),
    Row("gyro_g_product_{i}{pair}", "deg/h/g^2", "k*a{pair[0]}*a{pair[1]}"),
    Row("gyro_g_dependent_scale_{i}", "ppm/g", "k*a{i}*w{i}"),
    Row("gyro_scale_asymmetry_{i}", "ppm", "k*abs(w{i})"),
    Row("gyro_scale_quadratic_{i}", "ppm*s/deg", "k*w{i}**2"),
    Row("gyro_scale_cubic_{i}", "ppm*s^2/deg^2", "k*w{i}**3"),
    Row("gyro_misalignment_asymmetry_{i}{j}", "arcsec", "k*abs(w{j})"),
    Row("gyro_anisoinertia_{i}", "s/rad", "k*w{o}*w{p}"),
    Row("gyro_acceleration_sensitivity_{i}{any}", "s", "k*alpha{any}"),
    Row("gyro_dead_band_{i}", "deg/h", "-min(max(w{i}, -k), k)"),
    Row("gyro_hysteresis_{i}", "deg/h", "k*turned{i}"),
    Row("gyro_magnetic_{i}{any}", "deg/h/G", "k*B{any}"),
    Row("gyro_bias_temperature_rate_quadratic_{i}", "deg/h*min/degC^3", "k*dT**2*dTdt", drawn=False),
    *(
        row
        for triad, unit, signal in _BOTH
        for row in (
            Row(f"{triad}_bias_temperature_rate_{{i}}", f"{unit}*s/degC", "k*dTdt"),
            Row(f"{triad}_bias_warm_up_{{i}}", unit, "k*exp(-t/tau)", {"tau": "s"}),
            Row(f"{triad}_bias_ramp_{{i}}", f"{unit}/h", "k*t"),
            Row(f"{triad}_bias_step_{{i}}", unit, "k*(1 + sign(t - t0))/2", {"t0": "s"}),
            Row(f"{triad}_bias_in_motion_{{i}}", unit, "k*moving"),
            Row(f"{triad}_bias_settling_{{i}}", unit, "k*(1 - moving)*exp(-since/tau)", {"tau": "s"}),
            Row(f"{triad}_scale_ramp_{{i}}", "ppm/h", f"k*t*{signal}"),
            # The first four modes of a random walk (Karhunen-Loeve): a size each.
            *(
                Row(
                    f"{triad}_bias_random_walk_{{i}}{m}",
                    unit,
                    f"k*sin({m - 0.5}*pi*min(t/span, 1))/({m - 0.5}*pi)",
                    {"span": "s"},
                    drawn=False,
                )
                for m in (1, 2, 3, 4)
            ),
        )
    ),
    # The centre of mass moves at a constant rate: d along the axis named, q in quadrature to it.
    *(Row(f"gyro_mass_unbalance_ramp_{kind}{{i}}", "deg/h/g/h", f"k*t*a{{{kind}}}", drawn=False) for kind in "dq"),
    *(
        row
        for word, per, power in (
            ("temperature", "degC", "dT"),
            ("temperature_squared", "degC^2", "dT**2"),
            ("temperature_cubed", "degC^3", "dT**3"),
            ("temperature_rate", "degC*min", "dTdt"),
            ("temperature_rate_linear", "degC^2*min", "dT*dTdt"),
        )
        for row in _by_temperature(word, per, power)
        if power != "dTdt" or "misalignment" in row.names or "unbalance" in row.names
    ),
    # The triad is turned by the angle k about axis i: the next axis turns towards the one after it, that away from it.
    *(
        Row(
            f"accel_triad_{name}",
            unit,
            {"accel_{n}": f"k*{angle}*f{{m}}", "accel_{m}": f"-k*{angle}*f{{n}}"},
            drawn=False,
        )
        for name, unit, angle in (
            ("ramp_{i}", "arcsec/h", "t"),
            ("temperature_{i}", "arcsec/degC", "dT"),
            ("flexure_{i}{any}", "arcsec/g", "a{any}"),
        )
    ),
    Row("accel_rate_sensitivity_{i}{any}", "ug*s/deg", "k*wt{any}", drawn=False),
    Row("accel_relaxation_{i}", "ug/g", "k*(a{i} - y)", {"tau": "s"}, False, ("lag", "a{i}", "tau")),
    Row("accel_play_{i}", "ug", "k*(f{i} - y)/r", {"r": "g"}, False, ("play", "f{i}", "r")),
    # Two coupled beams beat at sqrt(w^2 - L^2), k = L^2; dither leaves 2 deg/h of its own.
    Row("gyro_lock_in_{i}", "deg^2/h^2", "w{i}*(sqrt(max(1 - k/(w{i}**2 + (2*deg/h)**2), 0)) - 1)", drawn=False),
    *(
        row
        for (triad, unit, signal), sense in zip(_BOTH, ("turned", "leant"), strict=True)
        for row in (
            Row(f"{triad}_creep_{{i}}", unit, f"k*{sense}{{i}}*(1 - moving)*exp(-since/tau)", {"tau": "s"}, False),
            Row(f"{triad}_bias_wrap_{{i}}{{any}}", unit, "k*wound{any}/(2*pi)", drawn=False),
            Row(f"{triad}_scale_temperature_rate_{{i}}", "ppm*min/degC", f"k*dTdt*{signal}", drawn=False),
            # Heating and cooling go along the two sides of a loop.
            Row(
                f"{triad}_bias_temperature_hysteresis_{{i}}",
                unit,
                "k*tanh(slow/threshold)",
                {"threshold": "degC/min"},
                drawn=False,
            ),
            Row(
                f"{triad}_scale_temperature_hysteresis_{{i}}",
                "ppm",
                f"k*tanh(slow/threshold)*{signal}",
                {"threshold": "degC/min"},
                drawn=False,
            ),
        )
    ),
)


_TABLE: dict[str, Entry] = {name: entry for row in _ROWS for name, entry in expand(row)}

_DELAYS: dict[str, tuple[str, ...]] = {
    **{f"{triad}_delay": tuple(s for s in SENSORS if s.startswith(triad)) for triad in ("gyro", "accel")},
    **{f"{sensor[:-2]}_delay_{sensor[-1]}": (sensor,) for sensor in SENSORS},
    "accel_triad_delay": SENSORS[3:],
}
_LOST = "gyro_lost_data"
LOST_AFTER_S = 3.0
"""Data of a turn are lost from this long after its start where the key does not say at what time."""
_LEVER_ARM = {f"lever_arm_{axis}": i for i, axis in enumerate(_XYZ)}
_SITE = {
    "reference_gravity": ("gravity", "mgal"),
    "reference_latitude": ("latitude", "arcsec"),
    "reference_deflection_east": ("east", "arcsec"),
}


@dataclass(frozen=True)
class Term:
    """Something added to one sensor's output."""

    name: str
    sensor: int
    """Index in `SENSORS`."""
    expression: Expression
    """rad/s or m/s^2."""
    parameters: dict[str, float]
    """k and others, SI; constants for the expression."""
    memory: tuple[str, ...] = ()
    """What `y` is in the expression, as in `Row`; empty where it remembers nothing."""


class Lost(NamedTuple):
    """Gyro data lost in a turn: its number (from 1), length (s), and the middle (s; None: early in the turn)."""

    turn: int
    length: float
    at: float | None = None


class SiteError(NamedTuple):
    """By what the site that a test believes in exceeds the true one.

    Gravity (m/s^2), latitude for the Earth's rate (rad), and deflection of the vertical to the East (rad).
    """

    gravity: float = 0.0
    latitude: float = 0.0
    east: float = 0.0


@dataclass(frozen=True)
class Hidden:
    """All hidden effects of a test."""

    terms: tuple[Term, ...] = ()
    delay_s: tuple[float, ...] = (0.0,) * 6
    """Of each of the six sensors (>= 0)."""
    lost: tuple[Lost, ...] = ()
    site: SiteError = field(default_factory=SiteError)
    lever_arm_m: Mapping[int, float] = field(default_factory=dict)
    """Components of the lever arm that are given."""
    coefficients: Mapping[str, float] = field(default_factory=dict)
    """Of the baseline (SI), as built."""
    sizes: Mapping[str, float] = field(default_factory=dict)
    """Size (SI) of every effect but the coefficients of the baseline, by the name that its estimate has."""

    @property
    def reads(self) -> frozenset[str]:
        """Variables that the terms read."""
        return frozenset[str]().union(*(term.expression.names for term in self.terms))

    @property
    def needs_temperature(self) -> bool:
        """Whether any term reads the temperature."""
        return bool(self.reads & TEMPERATURE_NAMES)


def register_row(row: Row) -> None:
    """Add a family of effects that a plug-in brings."""
    for name, entry in expand(row):
        if (name in _TABLE and _TABLE[name] != entry) or name in _UNITS:
            raise DataError(f"simulated effect '{name}' is there already")
        for part in entry.parts:
            _parsed(part, ("k", *row.options))
        _TABLE[name] = entry


ENTRY_POINTS = "sdimu_sim.effects"
"""Group of entry points that name callables without arguments, each returning a tuple of `Row`."""
_LOADED: set[str] = set()


def load_plugins(name: str) -> bool:
    """Register what other packages bring, once; tell whether `name` is known then."""
    for point in entry_points(group=ENTRY_POINTS):
        if point.name in _LOADED:
            continue
        try:
            rows = tuple(point.load()())
        except Exception as error:
            raise DataError(f"simulated effect '{point.name}' ({point.value}) does not load: {error}") from error
        for row in rows:
            register_row(row)
        _LOADED.add(point.name)
    return name in effect_names()


_UNITS: dict[str, str] = {
    **dict.fromkeys((*_DELAYS, _LOST), "ms"),
    **dict.fromkeys(_LEVER_ARM, "mm"),
    **{name: unit for name, (_, unit) in _SITE.items()},
    **COEFFICIENT_UNITS,
}
"""Customary unit of everything that is no row of the table."""


def effect_names() -> tuple[str, ...]:
    """Names that `parse_effects` takes, without the six sensors."""
    return (*sorted(_TABLE), *_UNITS)


def drawn_names() -> tuple[str, ...]:
    """Names that the campaign on hidden effects may draw."""
    delays = (name for name in _DELAYS if "triad" not in name)
    return (*sorted(name for name, entry in _TABLE.items() if entry.row.drawn), *sorted(delays), _LOST)


def size_unit(name: str) -> str:
    """Customary unit of the size of an effect of `effect_names`."""
    return _TABLE[name].row.unit if name in _TABLE else _UNITS[name]


def one_sided(name: str) -> bool:
    """Whether the size of an effect cannot be negative: a sensor delays and loses, it does not foresee."""
    return name in _DELAYS or name == _LOST or name.startswith(("gyro_dead_band_", "gyro_lock_in_"))


def effect_example(name: str) -> str:
    """Return a key with a size that is read, with the unit people use; `name` is one of `effect_names`."""
    if name == _LOST:
        return f"{name}(turn=1, at=100 s)=10 ms"
    options = {key: f"100 {unit}" for key, unit in _TABLE[name].row.options.items()} if name in _TABLE else {}
    return str(EffectKey(name, options, f"1 {size_unit(name)}"))


def canonical(text: str) -> str:
    """Write an effect in the one spelling; the former one (``NAME=VALUE; option=value``) is read."""
    return str(parse_key(text))


def parse_effects(texts: Iterable[str]) -> Hidden:
    """Read hidden effects.

    `texts`: canonical keys with a size; files of effects of one's own are put in before (`sdimu_sim.own_effects`).
    """
    found = _Found()
    for text in texts:
        key = parse_key(text)
        if not key.size and not key.equation:
            example = f"{key}=1 {size_unit(key.name)}" if key.name in effect_names() else "accel_quadratic_x=20 ug/g^2"
            raise DataError(f"effect '{text}' has no size (expected something like '{example}')")
        if key.name in SENSORS:
            formula = parse_expression(key.size, (*VARIABLES, *CONSTANTS))
            found.terms.append(Term(key.name, SENSORS.index(key.name), formula, {}))
        elif key.equation:
            name, formula, size = read_equation(key, *key.equation)
            found.terms.append(Term(name, SENSORS.index(key.equation[0]), formula, {"k": size}))
            found.sizes[name] = size
        else:
            _take_named(key, found)
    delay = tuple(found.delay[s] for s in SENSORS)
    return Hidden(
        tuple(found.terms), delay, tuple(found.lost), found.site, found.lever_arm, found.coefficients, found.sizes
    )


@dataclass
class _Found:
    """What has been read so far: the fields of `Hidden`."""

    terms: list[Term] = field(default_factory=list)
    delay: dict[str, float] = field(default_factory=lambda: dict.fromkeys(SENSORS, 0.0))
    lost: list[Lost] = field(default_factory=list)
    site: SiteError = field(default_factory=SiteError)
    lever_arm: dict[int, float] = field(default_factory=dict)
    coefficients: dict[str, float] = field(default_factory=dict)
    sizes: dict[str, float] = field(default_factory=dict)


_AXES = re.compile("[xyz]+")
"""What a coefficient has behind the name of its effect: its axes."""


def _take_named(key: EffectKey, found: _Found) -> None:
    name = key.name
    if name not in effect_names() and not load_plugins(name):
        own = [one for one in effect_names() if _AXES.fullmatch(one.removeprefix(f"{name}_"))]
        if own:
            raise DataError(
                f"effect '{name}' has several coefficients, each with a size of its own: name one of {', '.join(own)}"
            )
        raise DataError(f"unknown effect '{name}'{_suggestion(name)}")
    size = read_quantity(f"effect {name}", key.size, size_unit(name))
    if name in _TABLE:
        found.terms += _named_terms(key, size)
    elif name == _LOST:
        found.lost.append(_lost(key, size))
    else:
        read_options(key, {})
    if size < 0.0 and one_sided(name):
        instead = " (delay the other triad instead)" if name in _DELAYS else ""
        raise DataError(f"effect {name}: the size cannot be negative{instead}")
    if name in _DELAYS:
        for sensor in _DELAYS[name]:
            found.delay[sensor] += size
    elif name in _LEVER_ARM:
        found.lever_arm[_LEVER_ARM[name]] = size
    elif name in _SITE:
        found.site = found.site._replace(**{_SITE[name][0]: size})
    if name in COEFFICIENT_UNITS:
        found.coefficients[name] = size
    else:
        # A second variant of one effect is estimated under its key.
        found.sizes[str(EffectKey(name, key.options)) if name in found.sizes else name] = size


def _named_terms(key: EffectKey, size: float) -> list[Term]:
    row, parts = _TABLE[key.name]
    options = read_options(key, row.options)
    for name in ("tau", "span", "r", "threshold"):
        if options.get(name, 1.0) <= 0.0:
            raise DataError(f"effect {key.name}: {name} must be positive")
    values = {"k": size, **options}
    return [Term(key.name, SENSORS.index(part.sensor), _parsed(part, values), values, part.memory) for part in parts]


def _parsed(part: Part, values: Iterable[str]) -> Expression:
    return parse_expression(part.formula, (*VARIABLES, *CONSTANTS, *values, *(("y",) if part.memory else ())))


def _lost(key: EffectKey, size: float) -> Lost:
    units = {"turn": "1", "at": "s"}
    options = read_options(key, units if "at" in key.options else {"turn": "1"})
    if options["turn"] < 1 or options["turn"] % 1 or size <= 0.0:
        raise DataError(f"effect {key.name}: expected something like '{effect_example(key.name)}' (turns count from 1)")
    return Lost(int(options["turn"]), size, options.get("at"))


def _suggestion(name: str) -> str:
    close = difflib.get_close_matches(name, effect_names(), n=3)
    return f" (did you mean {', '.join(close)}?)" if close else f" (known: {', '.join(effect_names()[:6])}, ...)"
