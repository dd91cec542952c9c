"""The columns that a diagnosis looks at: catalogue, free inputs, own equations."""

from __future__ import annotations

import itertools
import re
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.effects import registry
from sdimu_calibration.core.effects.bias import ACCEL_BIAS, GYRO_BIAS
from sdimu_calibration.core.effects.effect import (
    AXES,
    CHANNELS,
    Column,
    Effect,
    Excitation,
    Parameter,
    Term,
    Timetable,
    product,
)
from sdimu_calibration.core.effects.motion import Motion
from sdimu_calibration.core.evidence.candidate import OWN
from sdimu_calibration.core.evidence.noise_kernels import constant_between

_CYCLES = np.arange(1.0, 20.0, 0.5)
"""Number of periods in a test: half a period apart, as `wave` is made finer about the best; up to one a stop of
`kim18`."""


def catalogue(times: Timetable, in_model: set[str], has_temperature: bool, of_a_set: bool = False) -> list[Effect]:
    """Every effect of the catalogue with the parameters that the model lacks.

    Parameters
    ----------
    times : Timetable
        Of the test: an effect with a time or a time constant comes in all variants that its scan makes for it.
    in_model : set of str
        Labels of the parameters that the model has.
    has_temperature : bool
        Whether the recording has a temperature; effects that need one are left out without.
    of_a_set : bool
        Also those that are tried only where several recordings are diagnosed together.
    """
    out: list[Effect] = []
    for name in registry.names():
        effect = registry.get(name)
        tried = effect.tried_in == "recording" or (effect.tried_in == "set" and of_a_set)
        if not tried or (effect.needs == "temperature" and not has_temperature):
            continue
        variants = effect.scan(times) if effect.scan else (effect,)
        for variant in variants:
            out += without(variant, in_model)
    return out


def without(effect: Effect, in_model: set[str]) -> list[Effect]:
    """Return the effect without the parameters (by label) that the model has: a list of one or none."""
    named = zip(effect.parameters, effect.labels, strict=True)
    missing = tuple(p.name for p, label in named if label not in in_model)
    return [effect.only(missing)] if missing else []


def free_inputs(times: Timetable) -> list[Effect]:
    """Give every sensor a constant error of its own in every dwell and every turn; one effect a segment."""
    stops = [constant_between(f"stop {k}", a, b) for k, a, b in times.stops]
    turns = [constant_between(f"turn {k + 1}", a, b) for k, a, b in times.turns]
    return stops + turns


def equations(has_temperature: bool) -> list[Effect]:
    """Monomials of the physical variables on every sensor: the alphabet of equations that no effect has.

    Forces to third order, the fourth powers of each, rates to second, their products, each also growing with time (and
    temperature), forces in turns alone; with |x| for even terms. What a registered effect already is comes twice; the
    catalogue then has the word.
    """

    def powers(total: int, kinds: int) -> list[tuple[int, ...]]:
        if kinds == 1:
            return [(total,)]
        return [(n, *rest) for n in range(total + 1) for rest in powers(total - n, kinds - 1)]

    out: list[Effect] = []
    for force, rate in [(f, r) for f in range(4) for r in range(3) if 0 < f + r <= 3]:
        grows = ("t", *(("T",) if has_temperature else ())) if force + rate == 1 else ()
        for pa, pw in itertools.product(powers(force, 3), powers(rate, 3)):
            for slow in ("", *grows):
                out += _monomial(pa, pw, slow)
    for i in range(3):
        out += _plain(f"e{AXES[i]}^2", product(_east, i, _east, i))
        for j in range(3):
            if j > i:
                out += _plain(f"e{AXES[i]} e{AXES[j]}", product(_east, i, _east, j))
            out += _plain(f"e{AXES[i]} a{AXES[j]}", product(_east, i, lambda m: m.a, j))
    # Between a square and a magnitude, which together imitate it.
    for i in range(3):
        out += _monomial(tuple(4 * (i == k) for k in range(3)), (0, 0, 0), "")
    # A sensitivity to force that is another one while the table turns.
    for along in powers(1, 3):
        out += _monomial(along, (0, 0, 0), "moving")
    out += _monomial((0, 0, 0), (0, 0, 0), "t^2")
    out += _monomial((0, 0, 0), (0, 0, 0), "T^2") if has_temperature else []
    return out


def periodic(duration: float, all_cycles: Floats = _CYCLES) -> list[Effect]:
    """Sine and cosine of time on every sensor.

    Parameters
    ----------
    duration : float
        Of the test (s).
    all_cycles : ndarray, shape (c,)
        Numbers of periods in the test (1).
    """
    out: list[Effect] = []
    for cycles in all_cycles:
        # The label holds the period as it is used: what is found can be added by its label.
        period = float(round(duration / cycles))
        for lead in (0.0, 90.0):
            out += wave(period, lead, (0.5 / duration, 90.0))
    return out


def wave(period: float, lead: float, spacing: tuple[float, float] = (0.0, 0.0)) -> list[Effect]:
    """Sine of time on every sensor.

    Parameters
    ----------
    period : float
        s.
    lead : float
        Phase at the start (deg).
    spacing : (float, float)
        Frequency (1/s) and phase (deg) from the next ones that are tried.
    """
    rate, phase = 0.5 * spacing[0], 0.5 * spacing[1]
    ahead = f"sin(2 pi t / {period:g} s {'-' if lead < 0.0 else '+'} {abs(lead):g} deg)"
    text = {0.0: f"sin(2 pi t / {period:g} s)", 90.0: f"cos(2 pi t / {period:g} s)"}.get(lead, ahead)

    def nearer(triad: int) -> Callable[[], tuple[Effect, ...]]:
        return lambda: tuple(
            wave(float(f"{1.0 / (1.0 / period + i * rate):.5g}"), round(lead + k * phase, 1), (rate, phase))[triad]
            for i in (-1, 0, 1)
            for k in (-1, 0, 1)
        )

    both = _plain(text, _wave(2.0 * np.pi / period, np.radians(lead)))
    return [
        replace(e, nearer=nearer(k) if phase > _LEAST_PHASE else None, excitation=_OVER_TIME)
        for k, e in enumerate(both)
    ]


_OVER_TIME = frozenset({Excitation.REPEATED_ATTITUDES})
_LEAST_PHASE = 3.0
"""Step of the phase (deg) at which the search for it ends: a finer one changes an amplitude of twenty sigma by less
than its noise."""


def own_equation(label: str) -> Effect | None:
    """Equation of `equations` or `periodic` with this label, such as ``gyro_x: ex^2``; None when neither has it."""
    found = _WAVE.search(label)
    known = equations(has_temperature=True)
    if found:
        word, period, sign, lead = found.groups()
        known = wave(float(period), 90.0 if word == "cos" else float(f"{sign or ''}{lead or 0}"))
    for effect in known:
        if label in {p.name for p in effect.parameters}:
            return effect.only((label,))
    return None


_WAVE = re.compile(r"(sin|cos)\(2 pi t / ([0-9.]+) s(?: ([+-]) ([0-9.]+) deg)?\)$")


def _east(motion: Motion) -> Floats:
    """East component of each body axis, shape (n, 3)."""
    return motion.C_nb[:, 1, :]


def _wave(rate: float, lead: float) -> Column:
    """Sine of time at `rate` (rad/s), `lead` (rad) ahead."""
    return lambda motion: np.asarray(np.sin(rate * (motion.t - 0.5 * motion.dt) + lead))


USUAL_TURN = float(np.deg2rad(2.0))
"""Rate of an ordinary turn (rad/s): what a rate in an equation is of the order of."""


def _plain(text: str, value: Callable[[Motion], Floats]) -> list[Effect]:
    """Own equation with a pure number as variable."""
    return _own(text, "", "", value)


def _own(text: str, unit: str, shown: str, value: Callable[[Motion], Floats], usual: float = 1.0) -> list[Effect]:
    """Own equation ``d(sensor) = k text``, gyros and accelerometers; units are appended to those of the sensor.

    `usual` is the order of size of `value` (SI): the prior of the bias over it is that of k.
    """

    def triad(word: str, base: tuple[str, str], like: Effect) -> Effect:
        first = CHANNELS.index(f"{word}_x")
        return Effect(
            name=f"{word}: {text}",
            title=OWN,
            equation=f"d{word}_i = k_i {text}",
            parameters=tuple(Parameter(f"{word}_{a}: {text}", base[0] + unit, base[1] + shown) for a in AXES),
            terms=tuple(Term(first + i, i) for i in range(3)),
            regressors=lambda m: np.repeat(value(m)[:, None], 3, axis=1),
            prior={grade: sigma / usual for grade, sigma in like.prior.items()},
        )

    # A term whose variable is of its usual order is not larger than the bias is.
    return [triad("gyro", ("rad/s", "deg/h"), GYRO_BIAS), triad("accel", ("m/s^2", "ug"), ACCEL_BIAS)]


_TIME: dict[str, Column] = {
    "": lambda m: np.ones(len(m.t)),
    "t": lambda m: m.t - 0.5 * m.dt,
    "t^2": lambda m: (m.t - 0.5 * m.dt) ** 2,
    "T": lambda m: m.temperature,
    "T^2": lambda m: m.temperature**2,
    "moving": lambda m: m.moving,
}
_TIME_UNIT = {"": "", "t": "/h", "t^2": "/h^2", "T": "/degC", "T^2": "/degC^2", "moving": ""}


def _monomial(pa: tuple[int, ...], pw: tuple[int, ...], factor: str) -> list[Effect]:
    """Own equation ``a^pa wt^pw factor`` on all six sensors; a in g, the rest in SI."""

    def value(motion: Motion) -> Floats:
        out = _TIME[factor](motion)
        for i in range(3):
            if pa[i]:
                out = out * motion.a[:, i] ** pa[i]
            if pw[i]:
                out = out * motion.w_table[:, i] ** pw[i]
        return out

    parts = [f"a{AXES[i]}" + (f"^{n}" if n > 1 else "") for i, n in enumerate(pa) if n]
    parts += [f"wt{AXES[i]}" + (f"^{n}" if n > 1 else "") for i, n in enumerate(pw) if n]
    parts += [factor] if factor else []
    text = " ".join(parts)
    order_a, order_w = sum(pa), sum(pw)
    power = f"^{order_w}" if order_w > 1 else ""
    unit = f"*s{power}/deg{power}" if order_w else ""
    unit += ("/g" + (f"^{order_a}" if order_a > 1 else "")) if order_a else ""
    unit += _TIME_UNIT[factor]
    si = unit.replace("deg", "rad").replace("/h", "/s").replace("radC", "K")
    return _own(text, si, unit, value, USUAL_TURN**order_w)
