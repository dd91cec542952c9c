"""Errors that no registered effect has, written twice: a formula to simulate, a regressor to know its size."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.effects.effect import CHANNELS, Effect, Parameter, Term, Timetable
from sdimu_calibration.core.effects.motion import Motion

OUTSIDE = "outside"
"""Prefix of the labels of shapes."""


@dataclass(frozen=True)
class Shape:
    """An error of one sensor of unit size."""

    label: str
    """``outside: sensor: formula``."""
    sensor: str
    formula: str
    """For the simulator, without the size; rad/s or m/s^2 per unit of the size."""
    value: Callable[[Motion], Floats]
    """The same of `Motion`, shape (n,)."""

    def effect(self) -> Effect:
        """Return the shape as an effect of which the evidence can say the sigma."""
        channel = CHANNELS.index(self.sensor)
        unit = "rad/s" if channel < 3 else "m/s^2"
        return Effect(
            name=self.label,
            title=OUTSIDE,
            equation=self.formula,
            parameters=(Parameter(self.label, unit, unit),),
            terms=(Term(channel, 0),),
            regressors=lambda m: self.value(m)[:, None],
            prior={},
            family=OUTSIDE,
        )


def shapes(times: Timetable) -> list[Shape]:
    """Every shape on every sensor that is drawn."""
    out: list[Shape] = []
    for sensor in CHANNELS:
        out += [_sine(sensor, period) for period in (300, 400, 500, 600, 700, 800, 900)]
        out += [_product(sensor, a, w) for a, w in (("x", "z"), ("y", "z"), ("z", "x"), ("y", "x"))]
        out += [_pulse(sensor, start, end) for _, start, end in times.stops[2:-1:3]]
        out += [_force_product(sensor, i, j) for i, j in ("xy", "yz", "zx")]
    return out


def _shape(sensor: str, formula: str, value: Callable[[Motion], Floats]) -> Shape:
    return Shape(f"{OUTSIDE}: {sensor}: {formula}", sensor, formula, value)


def _middle(m: Motion) -> Floats:
    return m.t - 0.5 * m.dt


def _sine(sensor: str, period: float) -> Shape:
    rate = 2.0 * np.pi / period
    return _shape(sensor, f"sin(2*pi*t/{period:g})", lambda m: np.asarray(np.sin(rate * _middle(m))))


def _product(sensor: str, a: str, w: str) -> Shape:
    i, j = "xyz".index(a), "xyz".index(w)
    return _shape(sensor, f"a{a}*w{w}", lambda m: m.a[:, i] * m.w[:, j])


def _pulse(sensor: str, start: float, end: float) -> Shape:
    formula = f"(sign(t - {start:.1f}) - sign(t - {end:.1f}))/2"
    return _shape(sensor, formula, lambda m: np.asarray(np.sign(_middle(m) - start) - np.sign(_middle(m) - end)) / 2.0)


def _force_product(sensor: str, i: str, j: str) -> Shape:
    a, b = "xyz".index(i), "xyz".index(j)
    return _shape(sensor, f"a{i}**2*a{j}", lambda m: m.a[:, a] ** 2 * m.a[:, b])


def outside_kind(label: str) -> str:
    """Word for a shape outside the catalogue: ``sine``, ``pulse``, ``rate product``, ``force product``."""
    for word, mark in (("sine", "sin("), ("pulse", "sign("), ("rate product", "*w")):
        if mark in label:
            return word
    return "force product"
