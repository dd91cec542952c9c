"""Whole simulated tests for the diagnosis, made once a run: 19 stops of 60 s at 20 Hz, every part of it public."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import pytest

from sdimu_calibration.core.diagnosis.diagnose import Diagnosis, climb
from sdimu_calibration.core.estimation.navigation_fit import FilterFit
from sdimu_calibration.core.estimation.prepared_test import PreparedTest
from sdimu_calibration.core.estimation.solve import solve
from sdimu_calibration.core.plan import Plan
from sdimu_calibration.core.recording import Recording
from sdimu_calibration.core.specification import ImuSpecification, Model, Site
from sdimu_calibration.storage.config import load_imu, load_model, load_plan
from sdimu_sim.core.scenario import Scenario, generate

SITE = Site(latitude_rad=float(np.radians(36.4)), height_m=80.0)
SEEDS = (101, 102, 103)


@dataclass(frozen=True)
class Bench:
    """Simulate, solve and diagnose, each once."""

    site: Site
    imu: ImuSpecification
    model: Model

    def plan(self, name: str = "kim18_signed") -> Plan:
        plan = load_plan(name)
        return replace(plan, dwell_s=(60.0,) * len(plan.dwell_s))

    def recording(self, seed: int = 101, effects: tuple[str, ...] = (), plan: str = "kim18_signed") -> Recording:
        return _recording(seed, effects, plan)

    def fit(self, seed: int = 101, effects: tuple[str, ...] = (), plan: str = "kim18_signed") -> FilterFit:
        return _fit(seed, effects, plan)

    def diagnosis(self, seed: int = 101, effects: tuple[str, ...] = (), plan: str = "kim18_signed") -> Diagnosis:
        return _diagnosis(seed, effects, plan)


BENCH = Bench(SITE, load_imu("dtg"), load_model("baseline"))


@cache
def _recording(seed: int, effects: tuple[str, ...], plan: str) -> Recording:
    scenario = Scenario(BENCH.plan(plan), BENCH.imu, BENCH.site, rate_hz=20.0, seed=seed, effects=effects)
    return generate(scenario)[0]


@cache
def _fit(seed: int, effects: tuple[str, ...], plan: str) -> FilterFit:
    return solve(PreparedTest(_recording(seed, effects, plan), BENCH.imu, BENCH.site), BENCH.model)


@cache
def _diagnosis(seed: int, effects: tuple[str, ...], plan: str) -> Diagnosis:
    return climb(_fit(seed, effects, plan))


@pytest.fixture(scope="session")
def bench() -> Bench:
    return BENCH
