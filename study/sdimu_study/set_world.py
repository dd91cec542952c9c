"""A drawn unit and its recordings, in memory: the worlds of the studies of sets."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from sdimu_calibration.core.estimation.prepared_test import PreparedTest
from sdimu_calibration.core.joint.member import Job, Member, Report, tried
from sdimu_calibration.core.plan import Plan
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.specification import ImuSpecification, Site
from sdimu_calibration.storage.files.config import load_plan
from sdimu_sim.core.scenario import Scenario, imu_truth
from sdimu_sim.core.truth import ImuTruth, draw_coefficients, turned_on
from sdimu_study import worlds
from sdimu_study.worlds import simulate

_RATE_HZ = 10.0
"""Sample rate (Hz): navigation cycles are 0.1 s at any rate, so this costs no information."""


@dataclass(frozen=True)
class Unit:
    """A unit of an IMU file; recordings count from its seed."""

    imu: ImuSpecification
    seed: int
    rng: np.random.Generator

    def sensor(self, effects: Sequence[str] = ()) -> ImuTruth:
        """Sensor of the unit, biases those of the mean over all power-ons."""
        scenario = Scenario(load_plan("kim18"), self.imu, Site(0.6), seed=self.seed, effects=tuple(effects))
        return imu_truth(scenario)

    def scenario(
        self, number: int, plan: Plan, site: Site, turn_on: dict[str, float], effects: Sequence[str] = (), **more: Any
    ) -> Scenario:
        """Make the scenario of a recording of the unit, its power-on drawn by `number`; `more` as of `Scenario`."""
        seed = 1000 * self.seed + number
        own = turned_on(draw_coefficients(self.imu, self.seed), turn_on, seed)
        return Scenario(
            plan, self.imu, site, rate_hz=_RATE_HZ, seed=seed, coefficients=own, effects=tuple(effects), **more
        )

    def recording(
        self, number: int, plan: Plan, site: Site, turn_on: dict[str, float], effects: Sequence[str] = ()
    ) -> PreparedTest:
        """Simulate a recording of the unit and open it as every recording is opened."""
        return opened(self.scenario(number, plan, site, turn_on, effects))


def opened(scenario: Scenario) -> PreparedTest:
    """Simulate a recording and open it as every recording is opened."""
    recording = simulate(scenario, imu_truth(scenario))
    return worlds.opened(recording, scenario.imu, scenario.site)


def members_of(tests: Sequence[PreparedTest]) -> list[Member]:
    """Name the recordings of a set, which are in memory; each is a power-on of its own."""
    return [Member(f"r{k}", partial(_given, test)) for k, test in enumerate(tests)]


def _given(test: PreparedTest) -> PreparedTest:
    return test


def here(jobs: Sequence[Job]) -> list[Report | DataError]:
    """Do jobs in this process."""
    return [tried(job) for job in jobs]
