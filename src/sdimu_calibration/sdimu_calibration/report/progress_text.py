"""A running calibration in words: how far the sigmas have fallen, and whether innovations are as large as promised."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from sdimu_calibration.core.units import from_si
from sdimu_calibration.core.verdict import Verdict
from sdimu_calibration.report.effect_words import effect_of_key
from sdimu_calibration.report.groups import groups, title

_FINE, _ALARM = "\N{BLACK CIRCLE}", "\N{BLACK UP-POINTING TRIANGLE}"
"""Shapes, not only colours, tell the light's states apart."""


@dataclass(frozen=True)
class Falling:
    """Largest sigma of one effect's coefficients now, in `unit`, and its share of the largest at the start."""

    effect: str
    sigma: float
    unit: str
    share: float


def falling(
    first: Mapping[str, float], now: Mapping[str, float], units: Mapping[str, str], effects: Sequence[str]
) -> list[Falling]:
    """Sum the sigmas up by effect, those that have fallen least first.

    `first`, `now`: sigma (SI) by coefficient at the start and now; `units`: customary unit by coefficient.
    """
    names = [name for name in now if first.get(name, 0.0) > 0.0]
    out = []
    # What was added while the test runs is an effect of its own, though its name begins as that of another.
    own = [name for name in names if name not in units]
    for effect, members in groups(names, [*effects, *own]).items():
        largest = max(now[names[k]] for k in members)
        start = max(first[names[k]] for k in members)
        unit = units.get(names[members[0]]) or _unit(names[members[0]])
        out.append(Falling(effect, from_si(largest, unit), unit, largest / start))
    return sorted(out, key=lambda f: -f.share)


def _unit(coefficient: str) -> str:
    """Customary unit of a coefficient that was added while the test runs; 1 for one that a file defines."""
    effect = effect_of_key(coefficient)
    return "1" if effect is None else next(p.display_unit for p in effect.parameters if p.name == coefficient)


def light(nis: Mapping[str, float], verdict: str) -> str:
    """Say whether the innovations of a stop are as large as promised, and how large: 1 is right.

    `nis`: mean squared innovation per degree of freedom at the stop, by channel; `verdict`: on the same numbers, as
    `core.live.stop_verdict` says it.
    """
    if not nis:
        return "innovations: none yet"
    mark = _FINE if verdict == Verdict.CONSISTENT else _ALARM
    numbers = " ".join(f"{channel} {value:.2f}" for channel, value in nis.items())
    return f"{mark} NIS of this stop {numbers}: {verdict}"


def sigma_words(fallen: Sequence[Falling], most: int = 2) -> str:
    """Name the effects that are known least, with what is left of their sigma."""
    return ", ".join(
        f"{title(f.effect)} {short(f.sigma)} {f.unit} ({short(100.0 * f.share)} %)" for f in list(fallen)[:most]
    )


def short(value: float) -> str:
    """Write a number with two digits, or whole."""
    return f"{value:.0f}" if value >= 99.5 else f"{value:.2g}"
