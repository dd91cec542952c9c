"""Where hidden effects are drawn: plans, sites, and how small an effect a test there can see."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from sdimu_calibration.core.diagnosis.candidates import catalogue
from sdimu_calibration.core.diagnosis.scan import scan
from sdimu_calibration.core.estimation.prepared_test import PreparedTest
from sdimu_calibration.core.estimation.solve import solve
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.specification import ImuSpecification, Model, Site
from sdimu_calibration.storage.files.config import load_plan
from sdimu_sim.core.scenario import Scenario, imu_truth
from sdimu_sim.core.temperature import TemperatureProfile
from sdimu_study.hidden_outside import shapes
from sdimu_study.run import simulate

PLANS = ("kim18", "kim18_signed", "recommended")
"""Plans that are drawn."""
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
    """One sigma of every candidate on a clean test.

    Attributes
    ----------
    plan : str
    latitude_deg : float
    family, label : tuple of str
    sigma : tuple of float
        SI; inf where a plan cannot test it.
    retention : tuple of float
        Share of the signature that the model's coefficients leave.
    prior : tuple of float
        Physical one-sigma size for the IMU's grade (SI).
    stops : tuple of (int, float, float)
        Index, start and end (s) of every dwell.
    """

    plan: str
    latitude_deg: float
    family: tuple[str, ...]
    label: tuple[str, ...]
    sigma: tuple[float, ...]
    retention: tuple[float, ...]
    prior: tuple[float, ...]
    stops: tuple[tuple[int, float, float], ...]


def sizes(plan: str, latitude_deg: float, imu: ImuSpecification, model: Model) -> Sizes:
    """Sigma of the whole catalogue, and of what is outside it, on a clean test of a plan at a latitude."""
    site = Site(math.radians(latitude_deg), 0.0)
    scenario = Scenario(
        plan=load_plan(plan), imu=imu, site=site, rate_hz=RATE_HZ, seed=_SEED + round(latitude_deg),
        temperature=WARM_UP, coefficients={},
    )
    fit = solve(PreparedTest(simulate(scenario, imu_truth(scenario)), imu, site), model)
    times = fit.timetable
    known = catalogue(times, set(fit.labels), True)
    evidence = fit.evidence([*known, *(s.effect() for s in shapes(times))])
    scanned = scan(evidence.information, evidence.model, evidence.weight)
    p = len(evidence.weight)
    return Sizes(
        plan, latitude_deg, tuple(c.family for c in evidence.candidates), tuple(c.label for c in evidence.candidates),
        tuple(scanned.sigma[p:].tolist()), tuple(scanned.retention[p:].tolist()), tuple(evidence.prior.tolist()),
        times.stops,
    )  # fmt: skip


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
