"""Small sets of recordings of one unit, simulated."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache, partial

import numpy as np
import pytest

from sdimu_calibration.core.estimation.prepared_test import PreparedTest
from sdimu_calibration.core.joint.member import Job, Member, Report, tried
from sdimu_calibration.core.joint.set_fit import SetOptions
from sdimu_calibration.core.plan import Plan
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.specification import Site
from sdimu_calibration.storage.files.config import load_imu, load_model, load_plan
from sdimu_sim.core.scenario import Scenario, imu_truth
from sdimu_sim.core.temperature import TemperatureProfile
from sdimu_sim.core.truth import draw_coefficients, turned_on
from sdimu_study.worlds import simulate

SITE = Site(latitude_rad=float(np.radians(36.4)), height_m=80.0)
IMU = load_imu("dtg")


class InMemory:
    """Opens a test that is in memory."""

    def __init__(self, test: PreparedTest) -> None:
        self.test = test

    def __call__(self) -> PreparedTest:
        return self.test


class Simulated:
    """Opens a test that is simulated when it is opened first: of some sets one recording alone is used."""

    def __init__(self, make: Callable[[], PreparedTest]) -> None:
        self.make = make

    @cached_property
    def test(self) -> PreparedTest:
        return self.make()

    def __call__(self) -> PreparedTest:
        return self.test


@dataclass(frozen=True)
class UnitSet:
    """Recordings of one unit, and its true coefficients: those of the mean over all power-ons."""

    members: tuple[Member, ...]
    truth: Mapping[str, float]


def short(name: str = "recommended", stops: int = 14, dwell_s: float = 30.0) -> Plan:
    plan = load_plan(name)
    stops = min(stops, len(plan.dwell_s))
    return replace(plan, dwell_s=(dwell_s,) * stops, turns=plan.turns[: stops - 1])


def switched_on(seed: int, power_on: int) -> dict[str, float]:
    """True coefficients of a unit in one of its power-ons."""
    return turned_on(draw_coefficients(IMU, seed), {"gyro_bias": 5e-8, "accel_bias": 2e-4}, 1000 * seed + power_on)


@lru_cache(maxsize=8)
def _recorded(
    seed: int,
    number: int,
    plan: Plan,
    effects: tuple[str, ...],
    shift: tuple[tuple[str, float], ...],
    mount: tuple[float, float, float] | None,
    power_on: int,
    noise: tuple[str, ...] = (),
    temperature: TemperatureProfile | None = None,
) -> PreparedTest:
    own = switched_on(seed, power_on)
    own |= {name: own[name] + size for name, size in shift}
    scenario = Scenario(
        plan,
        IMU,
        SITE,
        rate_hz=10.0,
        seed=1000 * seed + number,
        coefficients=own,
        effects=effects,
        mount_rad=mount,
        start_ns=(1_700_000_000 + 86_400 * number) * 10**9,
        noise=noise,
        temperature=temperature,
    )
    return PreparedTest(simulate(scenario, imu_truth(scenario)), IMU, SITE)


def unit_set(
    seed: int,
    plans: Sequence[Plan],
    effects: tuple[str, ...] = (),
    shift: Mapping[int, Mapping[str, float]] | None = None,
    noise: tuple[str, ...] = (),
    temperature: Sequence[TemperatureProfile] = (),
) -> UnitSet:
    members = []
    for k, plan in enumerate(plans):
        own = tuple((shift or {}).get(k, {}).items())
        heat = temperature[k] if temperature else None
        make = partial(_recorded, seed, k, plan, effects, own, None, k, noise, heat)
        members.append(Member(f"r{k}", Simulated(make)))
    return UnitSet(tuple(members), draw_coefficients(IMU, seed))


def here(jobs: Sequence[Job]) -> list[Report | DataError]:
    return [tried(job) for job in jobs]


@pytest.fixture(scope="session")
def options() -> SetOptions:
    return SetOptions(load_model("baseline"))


@pytest.fixture(scope="session")
def run() -> Callable[[Sequence[Job]], list[Report | DataError]]:
    return here
