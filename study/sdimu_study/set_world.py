"""A drawn unit and its recordings, in memory: the worlds of the study of sets."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sdimu_calibration.core.estimation.prepared_test import PreparedTest
from sdimu_calibration.core.front_door import OpeningOptions, open_test
from sdimu_calibration.core.joint.member import Job, Member, Report, tried
from sdimu_calibration.core.plan import Plan
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.specification import ImuSpecification, Site
from sdimu_calibration.storage.files.config import load_plan
from sdimu_sim.core.scenario import Scenario, imu_truth
from sdimu_sim.core.temperature import TemperatureProfile
from sdimu_sim.core.truth import ImuTruth, draw_coefficients, turned_on
from sdimu_study.grade_run import LATITUDES_DEG
from sdimu_study.run import simulate

_RATE_HZ = 10.0
"""Sample rate (Hz): navigation cycles are 0.1 s at any rate, so this costs no information."""


@dataclass(frozen=True)
class World:
    """A unit and where it is tested.

    Attributes
    ----------
    name : str
        Of the IMU file.
    imu : ImuSpecification
    seed : int
        Of the unit; recordings count from it.
    rng : Generator
    """

    name: str
    imu: ImuSpecification
    seed: int
    rng: np.random.Generator

    def site(self) -> Site:
        """Draw the site."""
        return Site(math.radians(float(self.rng.choice(LATITUDES_DEG))), 0.0)

    def unit(self, effects: Sequence[str] = ()) -> ImuTruth:
        """Sensor of the unit, biases those of the mean over all power-ons."""
        scenario = Scenario(load_plan("kim18"), self.imu, Site(0.6), seed=self.seed, effects=tuple(effects))
        return imu_truth(scenario)

    def scenario(
        self,
        number: int,
        plan: Plan,
        site: Site,
        turn_on: dict[str, float],
        effects: Sequence[str] = (),
        noise: Sequence[str] = (),
        temperature: TemperatureProfile | None = None,
    ) -> Scenario:
        """Make the scenario of a recording of the unit; its power-on is drawn by `number`."""
        seed = 1000 * self.seed + number
        own = turned_on(draw_coefficients(self.imu, self.seed), turn_on, seed)
        return Scenario(
            plan,
            self.imu,
            site,
            rate_hz=_RATE_HZ,
            seed=seed,
            coefficients=own,
            effects=tuple(effects),
            noise=tuple(noise),
            temperature=temperature,
        )

    def recording(
        self, number: int, plan: Plan, site: Site, turn_on: dict[str, float], effects: Sequence[str] = ()
    ) -> PreparedTest:
        """Simulate a recording of the unit and open it as every recording is opened."""
        return opened(self.scenario(number, plan, site, turn_on, effects))


def opened(scenario: Scenario) -> PreparedTest:
    """Simulate a recording and open it as every recording is opened."""
    recording = simulate(scenario, imu_truth(scenario))
    return PreparedTest(*open_test(recording, OpeningOptions(scenario.imu, scenario.site)))


class _Opened:
    """Gives a test that is in memory."""

    def __init__(self, test: PreparedTest) -> None:
        self.test = test

    def __call__(self) -> PreparedTest:
        return self.test


def members_of(tests: Sequence[PreparedTest]) -> list[Member]:
    """Name the recordings of a set; each is a power-on of its own."""
    return [Member(f"r{k}", _Opened(test)) for k, test in enumerate(tests)]


def here(jobs: Sequence[Job]) -> list[Report | DataError]:
    """Do jobs in this process."""
    return [tried(job) for job in jobs]
