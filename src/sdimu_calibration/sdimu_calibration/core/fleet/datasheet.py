"""A data sheet that was measured: terms of IEEE Std 528, 952, 647 and 1293 from results of units.

A term stands for several coefficients (axes) of one or more units. Its value is the largest size among them. Its
interval is made of simultaneous ones: with each of k coefficients within ``z sigma`` of its estimate, z at 95 % by
Bonferroni, the largest true size is between the largest of ``|v| - z sigma`` and the largest of ``|v| + z sigma``. The
value of a unit with several recordings is their mean; what they vary beyond their errors, all axes pooled, is in sigma.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.effects import registry
from sdimu_calibration.core.effects.effect import Effect
from sdimu_calibration.core.fleet.reml import LEVEL, RandomEffect, random_effect
from sdimu_calibration.core.fleet.sheet import Line
from sdimu_calibration.core.noise import Terms
from sdimu_calibration.core.origin import Origin
from sdimu_calibration.core.probability import normal_limit, student_limit
from sdimu_calibration.core.results import Calibration
from sdimu_calibration.core.units import from_si
from sdimu_calibration.core.wording import Option, Work

_FIXED = 1e-6
"""Share of the largest sigma of an effect below which one is rounding: the body frame makes the coefficient zero."""


@dataclass(frozen=True)
class Sample:
    """A result and the unit that it is of."""

    unit: str
    result: Calibration


@dataclass(frozen=True)
class NoiseOfUnit:
    """Terms of an Allan deviation."""

    source: str
    """Recording, or IMU file."""
    terms: Mapping[str, Terms] = field(default_factory=dict)
    """By channel, such as ``gyro_x``, SI."""
    stated: Mapping[tuple[str, str], float] = field(default_factory=dict)
    """Sizes that a file states without their errors (SI), by triad and term."""
    origin: Origin = field(default_factory=Origin)
    """Unit, IMU and date of the recording, as far as they are known."""
    path: str = ""
    """Of the file that it was read from."""


def known_terms() -> dict[str, str]:
    """Give every term of a data sheet, and the unit in which people read it."""
    out: dict[str, str] = {}
    for name in registry.names():
        effect = registry.get(name)
        if effect.sheet:
            out.setdefault(effect.sheet_term, effect.parameters[0].display_unit)
            if _varies(effect):
                out |= {effect.sheet_term + word: effect.parameters[0].display_unit for word in (_AGAIN, _COMPOSITE)}
    return out | {line.term: line.display_unit for line in _NOISE.values()}


def datasheet(samples: Sequence[Sample], noise: Sequence[NoiseOfUnit] = ()) -> tuple[Line, ...]:
    """Make the lines of a data sheet; what was not measured is there, too, with what would.

    `samples`: of one type and body frame; `noise`: noise found in recordings at rest.
    """
    lines = {term: Line(term, "", unit) for term, unit in known_terms().items()}
    for term in lines:
        effects = [e for e in map(registry.get, registry.names()) if e.sheet_term == term]
        if effects:
            lines[term] = _of_effects(term, effects, samples)
            if _varies(effects[0]):
                lines[term + _AGAIN] = _repeatability(term + _AGAIN, effects[0], samples)
    for key, line in _NOISE.items():
        lines[line.term] = _of_noise(key, line, samples, noise)
    for term in [term for term in lines if term.endswith(_COMPOSITE)]:
        bias = term.removesuffix(_COMPOSITE)
        lines[term] = _composite(lines[term], [lines[bias], lines[bias + _AGAIN], lines[bias + _IN_RUN]])
    return tuple(lines.values())


_AGAIN, _COMPOSITE, _IN_RUN = " repeatability", ", composite", " in-run stability"
"""What is added to the name of a bias."""


def _composite(line: Line, parts: Sequence[Line]) -> Line:
    """Put the parts of a bias together, root sum square: bias and repeatability at least."""
    known = [part for part in parts if math.isfinite(part.value)]
    if known[:2] != list(parts[:2]):
        return replace(line, unit=parts[0].unit, missing="measure bias and its repeatability")
    sums = (math.sqrt(sum(getattr(part, name) ** 2 for part in known)) for name in ("value", "low", "high"))
    value, low, high = sums
    return replace(
        line,
        unit=parts[0].unit,
        value=value,
        low=low,
        high=high,
        of=parts[0].of,
        recordings=parts[0].recordings,
        units=parts[0].units,
        condition=parts[0].condition,
        method="root sum square of " + ", ".join(part.term.partition(" ")[2] for part in known),
    )


def _varies(effect: Effect) -> bool:
    """Whether the constant of an effect is another one after each switch-on."""
    return effect.scope == "power-on" and not effect.needs


def conditions(samples: Sequence[Sample]) -> str:
    """Site, temperatures and rates of some results, as far as they say it."""
    origins = [sample.result.origin for sample in samples]
    sites = sorted({o.site for o in origins if o.site})
    low = [o.temperature_low_degc for o in origins if math.isfinite(o.temperature_low_degc)]
    high = [o.temperature_high_degc for o in origins if math.isfinite(o.temperature_high_degc)]
    rates = [o.rate_rad_s for o in origins if math.isfinite(o.rate_rad_s)]
    return "; ".join(
        word
        for word in (
            ", ".join(sites),
            f"{min(low):.0f} to {max(high):.0f} deg C" if low else "temperature not recorded",
            f"rates to {from_si(max(rates), 'deg/s'):.3g} deg/s" if rates else "",
        )
        if word
    )


@dataclass(frozen=True)
class _Rows:
    """Estimates of the coefficients of a term: one a result and coefficient."""

    value: Floats
    sigma: Floats
    unit: tuple[str, ...]
    coefficient: tuple[str, ...]
    power_on: tuple[str, ...]
    recordings: int

    @property
    def groups(self) -> list[str]:
        """Coefficient of a unit that each row is of."""
        return [f"{c} of {u}" for c, u in zip(self.coefficient, self.unit, strict=True)]


def _rows(effects: Sequence[Effect], samples: Sequence[Sample]) -> _Rows:
    found: list[tuple[float, float, str, str, str]] = []
    recordings = 0
    for number, sample in enumerate(samples):
        result = sample.result
        own = {p.name for e in effects for p in e.parameters}
        sigma = np.sqrt(np.maximum(np.diag(result.covariance), 0.0))
        places = [k for k, name in enumerate(result.names) if name in own]
        largest = max((float(sigma[k]) for k in places), default=0.0)
        free = [k for k in places if sigma[k] > _FIXED * largest]
        # A recording of which nobody says the power-on is taken as one of its own.
        label = result.origin.power_on or f"recording {number}"
        found += [(float(result.values[k]), float(sigma[k]), sample.unit, result.names[k], label) for k in free]
        recordings += _recordings(result) if free else 0
    columns = list(zip(*found, strict=True)) if found else [()] * 5
    value, sigma_, unit, coefficient, power_on = columns
    return _Rows(np.array(value), np.array(sigma_), tuple(unit), tuple(coefficient), tuple(power_on), recordings)


def _recordings(result: Calibration) -> int:
    """How many recordings a result is of."""
    return 1 if result.of_set is None else len(result.of_set.recordings)


def _of_effects(term: str, effects: Sequence[Effect], samples: Sequence[Sample]) -> Line:
    """Largest coefficient of a term."""
    parameter = effects[0].parameters[0]
    empty = Line(term, parameter.unit, parameter.display_unit)
    rows = _rows([e for e in effects if e.parameters[0].unit == parameter.unit], samples)
    if not len(rows.value):
        return replace(empty, missing=_what_would(effects))
    names, value, sigma, within = _by_group(rows)
    tests = len(value)
    tail = 0.5 * (1.0 - LEVEL) / tests
    z = normal_limit(tail) if within is None else student_limit(tail, within.dof)
    size = np.abs(value)
    worst = int(np.argmax(size))
    largest = f"largest of {tests} coefficients" if tests > 1 else "the one coefficient"
    once = "" if within is None else ", mean of the recordings of a unit"
    return replace(
        empty,
        value=float(size[worst]),
        low=max(0.0, float((size - z * sigma).max())),
        high=float((size + z * sigma).max()),
        rms=float(np.sqrt(np.mean(size**2))),
        of=names[worst],
        recordings=rows.recordings,
        units=len(set(rows.unit)),
        condition=conditions(samples),
        method=f"{largest}{once}",
    )


def _by_group(rows: _Rows) -> tuple[list[str], Floats, Floats, RandomEffect | None]:
    """Mean and sigma of each coefficient of each unit, and what its results vary."""
    groups = rows.groups
    names = list(dict.fromkeys(groups))
    within = None
    if len(names) < len(groups):
        within = random_effect(rows.value, rows.sigma, groups)
    member = np.equal.outer(np.array(groups), np.array(names)).astype(float)
    weight = 1.0 / (rows.sigma**2 + (0.0 if within is None else within.spread**2))
    total = weight @ member
    return names, (weight * rows.value) @ member / total, 1.0 / np.sqrt(total), within


def _what_would(effects: Sequence[Effect]) -> str:
    """Say what a test must do so that a term is measured."""
    first = effects[0]
    needs = [*sorted(e.value for e in first.excitation), *(["a recorded temperature"] if first.needs else [])]
    told = f"; needs {', '.join(needs)}" if needs else ""
    return f"add it to the model: {Work.CALIBRATE} BAG {Option.ADD} {first.name}{told}"


def _repeatability(term: str, effect: Effect, samples: Sequence[Sample]) -> Line:
    """Estimate what varies from turn-on to turn-on: of a joint fit where there is one, else of results of a unit."""
    parameter = effect.parameters[0]
    empty = Line(term, parameter.unit, parameter.display_unit)
    joint = [
        (t, s.unit)
        for s in samples
        if s.result.of_set is not None
        for t in s.result.of_set.turn_on
        if t.effect == effect.name
    ]
    if joint:
        best, unit = max(joint, key=lambda pair: pair[0].power_ons)
        return replace(
            empty,
            value=best.sigma,
            low=best.low,
            high=best.high,
            of=unit,
            recordings=int(best.power_ons),
            units=1,
            condition=conditions(samples),
            method=f"joint fit over {int(best.power_ons)} power-ons",
        )
    rows = _one_a_power_on(_rows([effect], samples))
    groups = rows.groups
    if len(set(groups)) == len(groups):
        missing = f"record the unit after two power-ons at least, and state them: {Option.POWER_ON}"
        return replace(empty, missing=missing)
    found = random_effect(rows.value, rows.sigma, groups)
    repeated = {unit for unit, group in zip(rows.unit, groups, strict=True) if groups.count(group) > 1}
    return replace(
        empty,
        value=found.spread,
        low=found.low,
        high=found.high,
        recordings=rows.recordings,
        units=len(repeated),
        condition=conditions(samples),
        method=f"standard deviation from turn-on to turn-on, all axes, {found.dof} degrees of freedom",
    )


def _one_a_power_on(rows: _Rows) -> _Rows:
    """Mean of the results of one power-on, which share its bias."""
    keys = [f"{group} in {on}" for group, on in zip(rows.groups, rows.power_on, strict=True)]
    names = list(dict.fromkeys(keys))
    if len(names) == len(keys):
        return rows
    first = [keys.index(name) for name in names]
    member = np.equal.outer(np.array(keys), np.array(names)).astype(float)
    weight = rows.sigma**-2.0
    total = weight @ member
    return replace(
        rows,
        value=(weight * rows.value) @ member / total,
        sigma=1.0 / np.sqrt(total),
        unit=tuple(rows.unit[k] for k in first),
        coefficient=tuple(rows.coefficient[k] for k in first),
        power_on=tuple(rows.power_on[k] for k in first),
    )


_LONG_REST = f"record it at rest for hours: {Work.NOISE} BAG, and give its folder with {Option.NOISE}"
_NOISE = {
    ("gyro", "white"): Line("gyro angle random walk", "rad/s/sqrt(Hz)", "deg/sqrt(h)", missing=_LONG_REST),
    ("gyro", "instability"): Line("gyro bias in-run stability", "rad/s", "deg/h", missing=_LONG_REST),
    ("gyro", "random_walk"): Line("gyro rate random walk", "rad/s/sqrt(s)", "deg/h/sqrt(h)", missing=_LONG_REST),
    ("accel", "white"): Line("accelerometer velocity random walk", "m/s^2/sqrt(Hz)", "m/s/sqrt(h)", missing=_LONG_REST),
    ("accel", "instability"): Line("accelerometer bias in-run stability", "m/s^2", "ug", missing=_LONG_REST),
    ("accel", "random_walk"): Line("accelerometer bias random walk", "m/s^2/sqrt(s)", "ug/sqrt(h)", missing=_LONG_REST),
}
"""Terms of the noise: triad and term of the Allan deviation (IEEE Std 952, annex C)."""
_ALLAN = ("quantisation", "white", "instability", "random_walk")
"""Terms of an Allan deviation, in the order of `Terms`."""
_LEARNED = {"instability": "flicker", "random_walk": "random_walk"}
"""Kind of noise that a calibration learns, by term of the Allan deviation."""


def _of_noise(key: tuple[str, str], line: Line, samples: Sequence[Sample], noise: Sequence[NoiseOfUnit]) -> Line:
    """Take the largest size of a term of the noise: of rests, else of what calibrations learned, else of a file."""
    triad, term = key
    rests = [(n.source, channel, found) for n in noise for channel, found in n.terms.items() if channel[:-2] == triad]
    if rests:
        return _of_rests(line, _ALLAN.index(term), rests)
    learned = [
        (t, s.unit) for s in samples for t in s.result.noise if t.triad == triad and t.kind == _LEARNED.get(term)
    ]
    if learned:
        largest, unit = max(learned, key=lambda pair: pair[0].size)
        return replace(
            line,
            value=largest.size,
            low=max(t.low for t, _ in learned),
            high=max(t.high for t, _ in learned),
            of=unit,
            recordings=len(learned),
            units=len({u for _, u in learned}),
            condition=conditions(samples),
            method="learned in the calibration, all axes",
            missing="",
        )
    stated = [(n.stated[key], n.source) for n in noise if n.stated.get(key, 0.0) > 0.0]
    if stated:
        size, source = max(stated)
        return replace(line, value=size, method=f"of {source}, which states no interval", missing="")
    return line


def _of_rests(line: Line, k: int, rests: Sequence[tuple[str, str, Terms]]) -> Line:
    """Take the largest of a term over channels and recordings; of one that is not seen only the bound counts."""
    z = normal_limit(0.5 * (1.0 - LEVEL) / len(rests))
    value = np.array([float(t.value[k]) if t.seen[k] else 0.0 for _, _, t in rests])
    half = z * np.array([float(t.sigma[k]) for _, _, t in rests])
    low = np.where(value > 0.0, value - half, 0.0)
    high = np.array([max(float(t.value[k]), 0.0) for _, _, t in rests]) + half
    worst = int(np.argmax(value))
    return replace(
        line,
        value=float(value[worst]),
        low=max(0.0, float(low.max())),
        high=float(high.max()),
        rms=float(np.sqrt(np.mean(value**2))),
        of=f"{rests[worst][1]} in {rests[worst][0]}",
        recordings=len({source for source, _, _ in rests}),
        units=0,
        method=f"Allan deviation of rests, largest of {len(rests)} channels",
        missing="",
    )
