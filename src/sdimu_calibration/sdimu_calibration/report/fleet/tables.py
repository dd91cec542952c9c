"""Rows of a fleet as text: coefficients over units, who is out, what is common, what follows the date."""

from __future__ import annotations

from collections.abc import Mapping

from sdimu_calibration.core import plain_text
from sdimu_calibration.core.fleet.common import CommonEffect
from sdimu_calibration.core.fleet.population import Coefficient
from sdimu_calibration.core.fleet.study import Study
from sdimu_calibration.core.units import from_si
from sdimu_calibration.report.table import as_far

HEADINGS = ("coefficient", "unit", "mean", "+-", "spread", "95 %", "within", "p", "out")
COMMON_HEADINGS = ("effect", "unit", "units", "mean", "+-", "spread", "largest z", "p", "q", "named, or looks the same")
TREND_HEADINGS = ("coefficient", "change", "a year", "+-", "unit", "p", "q", "named")
_NOTHING_VARIES = "0"
_ALIKE = 4
"""Effects that look the same which are listed: fleet.json has all."""


def rows(done: Study, units: Mapping[str, str]) -> list[list[str]]:
    """One row of `HEADINGS` a coefficient; numbers in its customary unit.

    `units`: customary unit of each coefficient.
    """
    out: dict[str, list[str]] = {}
    for one in done.people.out:
        out.setdefault(one.coefficient, []).append(one.unit)
    return [_row(one, units[one.name], out.get(one.name, [])) for one in done.people.coefficients]


def _row(one: Coefficient, unit: str, out: list[str]) -> list[str]:
    found = one.between
    low, high = found.mean_interval
    half = from_si(0.5 * (high - low), unit)
    mean, beside = as_far((from_si(found.mean, unit), half), half)
    spread, least, most = (three(from_si(size, unit)) for size in (found.spread, found.low, found.high))
    within = "" if one.within is None else three(from_si(one.within.spread, unit))
    p = probability(found.p_value)
    return [one.name, unit, mean, beside, spread, f"{least}..{most}", within, p, ", ".join(out)]


def common_rows(done: Study, units: Mapping[str, str], most: int) -> list[list[str]]:
    """Rows of `COMMON_HEADINGS`: effects that are named, and the nearest others up to `most` in all."""
    return [
        [
            one.name,
            units[one.name],
            str(one.units),
            *as_far(
                [from_si(v, units[one.name]) for v in (one.mean, one.mean_sigma)],
                from_si(one.mean_sigma, units[one.name]),
            ),
            three(from_si(one.spread, units[one.name])),
            f"{one.largest_z:.1f}",
            probability(one.p_value),
            probability(one.q_value),
            _named(one),
        ]
        for k, one in enumerate(done.common)
        if one.named or k < most
    ]


def _named(one: CommonEffect) -> str:
    if not one.named:
        return ""
    return f"yes; or {', '.join(one.alike[:_ALIKE])}" if one.alike else "yes"


def trend_rows(done: Study, units: Mapping[str, str], most: int) -> list[list[str]]:
    """Rows of `TREND_HEADINGS`: slopes that are named, and the nearest others up to `most` in all."""
    out = []
    for k, one in enumerate(done.slopes):
        if not one.named and k >= most:
            break
        unit = units[one.coefficient]
        slope, sigma = (from_si(value, unit) for value in (one.slope, one.slope_sigma))
        out.append(
            [
                one.coefficient,
                one.kind,
                *as_far((slope, sigma), sigma),
                f"{unit}/year",
                probability(one.p_value),
                probability(one.q_value),
                "yes" if one.named else "",
            ]
        )
    return out


def sentences(done: Study, units: Mapping[str, str]) -> list[str]:
    """Say what stands out, one sentence each; the first is of the units that are out."""
    out = [
        f"{one.unit} is out by {one.coefficient}: {one.deviate:+.1f} sigma from the population of the others "
        f"(p {probability(one.p_value)} over all units and coefficients)."
        for one in done.people.out
    ]
    told = out or ["No unit is out."]
    told += [
        f"Common to the type: {one.name}, mean {from_si(one.mean, units[one.name]):+.3g} and spread "
        f"{from_si(one.spread, units[one.name]):.2g} {units[one.name]} over {one.units} units; largest in one unit "
        f"{one.largest_z:.1f} sigma" + (f"; looks the same: {', '.join(one.alike[:_ALIKE])}." if one.alike else ".")
        for one in done.common
        if one.named
    ]
    told += [
        f"{one.coefficient} changes {one.kind}: {from_si(one.slope, units[one.coefficient]):+.3g} +- "
        f"{from_si(one.slope_sigma, units[one.coefficient]):.2g} {units[one.coefficient]} a year."
        for one in done.slopes
        if one.named
    ]
    return told


def three(value: float) -> str:
    """Write a size with three digits; one that is nothing beside any unit as 0."""
    return _NOTHING_VARIES if abs(value) < 1e-12 else plain_text.three(value)


def probability(p: float) -> str:
    """Write a probability with two digits, and none below 1e-4."""
    return "<1e-4" if p < 1e-4 else f"{p:.2g}"
