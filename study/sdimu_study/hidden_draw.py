"""What is hidden in a test: one effect, two, none, something outside the catalogue, or wrong noise; and how small."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from sdimu_calibration.core.diagnosis.candidates import catalogue
from sdimu_calibration.core.diagnosis.scan import scan
from sdimu_calibration.core.effect_key import sized
from sdimu_calibration.core.estimation.prepared_test import PreparedTest
from sdimu_calibration.core.estimation.solve import solve
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.specification import ImuSpecification, Model, Site
from sdimu_calibration.storage.files.config import load_plan
from sdimu_sim.core.hidden import one_sided, size_unit
from sdimu_sim.core.scenario import Scenario, imu_truth
from sdimu_sim.core.temperature import TemperatureProfile
from sdimu_study.hidden_outside import OUTSIDE, outside_kind, shapes
from sdimu_study.plans import FILED
from sdimu_study.worlds import PLAUSIBLE, TESTABLE, Truth, option_of, rng_of, simulate

KINDS = ("weak", "strong", "pair", "clean", "outside", "noise")
"""One effect at 5 sigma; one at 8 to 30; two at 10 to 30 each; none; not in the catalogue at 15 to 40; wrong noise."""
FAULTS = ("outliers 0.1 %", "outliers 1 %", "gyro noise x1.3", "accel noise x1.3")
_SPAN = {"weak": (5.0, 5.0), "strong": (8.0, 30.0), "pair": (10.0, 30.0), "outside": (15.0, 40.0)}
LATITUDES_DEG = (20.0, 40.0, 60.0)
"""Latitudes at which sizes are computed; between them the logarithm of a size is interpolated."""
RATE_HZ = 20.0
"""Sample rate of the campaign: navigation cycles are 0.1 s at any rate, so this costs no information."""
WARM_UP = TemperatureProfile(25.0, 8.0, 1200.0, 0.3, 900.0)
"""Temperature in every test, so that what depends on it can be tested."""
_SEED = 900_001
_STEADY = 4.0
"""Sigmas at the latitudes differ by less than this (horizontal earth rate alone: 1.9)."""


@dataclass(frozen=True)
class Sizes:
    """One sigma of every candidate on a clean test."""

    plan: str
    latitude_deg: float
    family: tuple[str, ...]
    label: tuple[str, ...]
    sigma: tuple[float, ...]
    """SI; inf where a plan cannot test it."""
    retention: tuple[float, ...]
    """Share of the signature that the model's coefficients leave."""
    prior: tuple[float, ...]
    """Physical one-sigma size for the IMU's grade (SI)."""
    stops: tuple[tuple[int, float, float], ...]
    """Index, start and end (s) of every dwell."""


def sizes(plan: str, latitude_deg: float, imu: ImuSpecification, model: Model) -> Sizes:
    """Sigma of the whole catalogue, and of what is outside it, on a clean test of a plan at a latitude."""
    site = Site(math.radians(latitude_deg), 0.0)
    scenario = Scenario(
        plan=load_plan(plan),
        imu=imu,
        site=site,
        rate_hz=RATE_HZ,
        seed=_SEED + round(latitude_deg),
        temperature=WARM_UP,
        coefficients={},
    )
    fit = solve(PreparedTest(simulate(scenario, imu_truth(scenario)), imu, site), model)
    times = fit.timetable
    known = catalogue(times, set(fit.labels), True)
    evidence = fit.evidence([*known, *(s.effect() for s in shapes(times))])
    scanned = scan(evidence.information, evidence.model, evidence.weight)
    p = len(evidence.weight)
    return Sizes(
        plan,
        latitude_deg,
        tuple(c.family for c in evidence.candidates),
        tuple(c.label for c in evidence.candidates),
        tuple(scanned.sigma[p:].tolist()),
        tuple(scanned.retention[p:].tolist()),
        tuple(evidence.prior.tolist()),
        times.stops,
    )


def between(tables: Sequence[Sizes], plan: str, latitude_deg: float) -> Sizes:
    """Sizes of a plan at any latitude between those of `tables`."""
    own = sorted((t for t in tables if t.plan == plan), key=lambda t: t.latitude_deg)
    if not own:
        raise DataError(f"plan '{plan}': no sizes were computed for it")
    grid = np.array([t.latitude_deg for t in own])
    high = int(np.clip(np.searchsorted(grid, latitude_deg), 1, max(len(grid) - 1, 1))) if len(own) > 1 else 0
    if not high:
        return own[0]
    low = high - 1
    share = (latitude_deg - grid[low]) / (grid[high] - grid[low])
    a, b = np.array(own[low].sigma), np.array(own[high].sigma)
    every = np.array([t.sigma for t in own])
    with np.errstate(invalid="ignore"):
        # Each table has a mount of its own: what hangs on the mount (products that vanish without one) has no size.
        steady = np.isfinite(every).all(axis=0) & (every.max(axis=0) < _STEADY * every.min(axis=0))
        sigma = np.where(steady, np.exp((1 - share) * np.log(a) + share * np.log(b)), np.inf)
    retention = np.minimum(own[low].retention, own[high].retention)
    return replace(
        own[low], latitude_deg=latitude_deg, sigma=tuple(sigma.tolist()), retention=tuple(retention.tolist())
    )


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
    rng = rng_of(seed, "hidden", kind)
    plan = str(rng.choice(FILED))
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
        one = _outside(rng, found, size) if kind == "outside" else drawn_of(rng, found, size, hideable)
        if all(_sensor(one.name) != _sensor(other.name) for other in truths):
            truths.append(one)
    return Draw(kind, plan, latitude, tuple(truths))


def drawn_of(rng: np.random.Generator, found: Sizes, size: float, hideable: frozenset[str]) -> Truth:
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
    option = option_of(found.label[k])
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


def _text(name: str, value: float, option: tuple[str, float] | None) -> str:
    """Canonical key with its size, in the unit that people use."""
    inside = "" if option is None else f"({option[0]}={option[1]:g}{'' if option[0] == 'turn' else ' s'})"
    return sized(name + inside, value, size_unit(name))


def _sensor(name: str) -> str:
    """Sensor axis that a parameter acts on, as near as its name says."""
    triad, _, rest = name.partition("_")
    return f"{triad} {rest.rpartition('_')[2][:1]}"
