"""Draw what is hidden in a test: one effect, two, none, something outside the catalogue, or wrong noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from zlib import crc32

import numpy as np

from sdimu_calibration.core.effect_key import parse_key, sized
from sdimu_calibration.core.effects.selection import resolve
from sdimu_sim.core.hidden import drawn_names, one_sided, size_unit
from sdimu_study.hidden_outside import OUTSIDE
from sdimu_study.hidden_sizes import PLANS, Sizes, between

KINDS = ("weak", "strong", "pair", "clean", "outside", "noise")
"""One effect at 5 sigma; one at 8 to 30; two at 10 to 30 each; none; not in the catalogue at 15 to 40; wrong noise."""
FAULTS = ("outliers 0.1 %", "outliers 1 %", "gyro noise x1.3", "accel noise x1.3")
TESTABLE = 0.05
"""Least share of the signature that the model must leave: less is as good as a coefficient of the model."""
PLAUSIBLE = 3.0
"""An effect is drawn only where this many of its physical one-sigma sizes reach the size to be drawn."""
_SPAN = {"weak": (5.0, 5.0), "strong": (8.0, 30.0), "pair": (10.0, 30.0), "outside": (15.0, 40.0)}


@dataclass(frozen=True)
class Truth:
    """A hidden effect.

    Attributes
    ----------
    name : str
        Of the parameter, as the registry has it.
    family : str
    option : tuple of (str, float) or None
        What enters nonlinearly: ``("tau", 730.0)``.
    value : float
        SI.
    sigmas : float
        Size in the sigma of a clean test.
    text : str
        What the simulator takes.
    """

    name: str
    family: str
    option: tuple[str, float] | None
    value: float
    sigmas: float
    text: str


@dataclass(frozen=True)
class Draw:
    """One test: where, on which plan, and what is hidden in it."""

    kind: str
    plan: str
    latitude_deg: float
    truths: tuple[Truth, ...] = ()
    fault: str = ""


def draw(kind: str, seed: int, tables: Sequence[Sizes], hideable: frozenset[str]) -> Draw:
    """Draw a test.

    Parameters
    ----------
    kind : str
        One of `KINDS`.
    seed : int
    tables : sequence of Sizes
        Of every plan at several latitudes.
    hideable : frozenset of str
        Parameters that the simulator can hide (`hideable_names`).
    """
    rng = np.random.default_rng(np.random.SeedSequence([seed, crc32(f"hidden {kind}".encode())]))
    plan = str(rng.choice(PLANS))
    latitude = float(rng.uniform(20.0, 60.0))
    found = between(tables, plan, latitude)
    if kind == "clean":
        return Draw(kind, plan, latitude)
    if kind == "noise":
        return Draw(kind, plan, latitude, fault=str(rng.choice(FAULTS)))
    low, high = _SPAN[kind]
    count = 2 if kind == "pair" else 1
    truths: list[Truth] = []
    while len(truths) < count:
        size = float(np.exp(rng.uniform(np.log(low), np.log(high))))
        one = _outside(rng, found, size) if kind == "outside" else drawn_effect(rng, found, size, hideable)
        if all(_sensor(one.name) != _sensor(other.name) for other in truths):
            truths.append(one)
    return Draw(kind, plan, latitude, tuple(truths))


def hideable_names() -> frozenset[str]:
    """Parameters that both the simulator and the registry have."""
    return frozenset(drawn_names())


def drawn_effect(rng: np.random.Generator, found: Sizes, size: float, hideable: frozenset[str]) -> Truth:
    """Draw family, then parameter, then variant, so that every family is as frequent as any other.

    Parameters
    ----------
    rng : Generator
    found : Sizes
        Of the plan at the latitude.
    size : float
        In sigmas of a clean test.
    hideable : frozenset of str
        Parameters that may be drawn.
    """
    pool: dict[str, dict[str, list[int]]] = {}
    for k, label in enumerate(found.label):
        name = label.partition("(")[0]
        if name not in hideable or not found.retention[k] >= TESTABLE:
            continue
        if size * found.sigma[k] <= PLAUSIBLE * found.prior[k]:
            pool.setdefault(found.family[k], {}).setdefault(name, []).append(k)
    family = str(rng.choice(sorted(pool)))
    name = str(rng.choice(sorted(pool[family])))
    k = int(rng.choice(pool[family][name]))
    value = size * found.sigma[k] * float(rng.choice((-1.0, 1.0)))
    if one_sided(name):
        value = abs(value)
    option = _option(found.label[k])
    if option and option[0] == "tau":
        option = ("tau", option[1] * float(rng.uniform(2.0**-0.5, 2.0**0.5)))
    return Truth(name, family, option, value, size, _text(name, value, option))


def _outside(rng: np.random.Generator, found: Sizes, size: float) -> Truth:
    kinds: dict[str, list[int]] = {}
    for k, label in enumerate(found.label):
        # Twice the share asked of an effect: what the coefficients swallow cannot be missing.
        if found.family[k] == OUTSIDE and found.retention[k] >= 2.0 * TESTABLE:
            kinds.setdefault(outside_kind(label), []).append(k)
    k = int(rng.choice(kinds[str(rng.choice(sorted(kinds)))]))
    value = size * found.sigma[k] * float(rng.choice((-1.0, 1.0)))
    _, sensor, formula = (part.strip() for part in found.label[k].split(":"))
    return Truth(found.label[k], OUTSIDE, None, value, size, f"{sensor}={value:.9e}*({formula})")


def outside_kind(label: str) -> str:
    """Word for a shape outside the catalogue: ``sine``, ``pulse``, ``rate product``, ``force product``."""
    for word, mark in (("sine", "sin("), ("pulse", "sign("), ("rate product", "*w")):
        if mark in label:
            return word
    return "force product"


def _option(label: str) -> tuple[str, float] | None:
    """Read the first option of a label: ``("tau", 300.0)``."""
    options = parse_key(label).options
    return next(((key, float(value.split()[0])) for key, value in options.items()), None)


def _text(name: str, value: float, option: tuple[str, float] | None) -> str:
    """Canonical key with its size, in the unit that people use."""
    inside = "" if option is None else f"({option[0]}={option[1]:g}{'' if option[0] == 'turn' else ' s'})"
    return sized(name + inside, value, size_unit(name))


def _sensor(name: str) -> str:
    """Sensor axis that a parameter acts on, as near as its name says."""
    triad, _, rest = name.partition("_")
    return f"{triad} {rest.rpartition('_')[2][:1]}"


def family_of(label: str) -> str:
    """Registry name of the effect that a label of the catalogue belongs to."""
    effect = resolve(label.partition("(")[0])
    return effect.family or effect.name
