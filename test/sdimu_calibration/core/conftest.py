"""What the tests of the core share: general attitudes, and small simulated tests without noise or with it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import pytest
from hypothesis import settings

from rate_table_sim.core.specification import TableSpecification
from sdimu_calibration.core.diagnosis.diagnose import Diagnosis, climb
from sdimu_calibration.core.estimation.navigation_fit import NavigationFit
from sdimu_calibration.core.estimation.prepared_test import PreparedTest
from sdimu_calibration.core.estimation.solve import solve
from sdimu_calibration.core.plan import Plan, Turn
from sdimu_calibration.core.recording import Recording
from sdimu_calibration.core.rotation import rotation_matrix
from sdimu_calibration.core.specification import ImuSpecification, Model, Site
from sdimu_calibration.core.units import to_si
from sdimu_calibration.storage.files.config import load_imu, load_model, load_plan
from sdimu_sim.core.scenario import Scenario, generate

# The first call of a compiled function may compile it: no deadline says anything about the claim. The same examples
# every time: a failure belongs to the change that made it.
settings.register_profile("compiled", deadline=None, derandomize=True)
settings.load_profile("compiled")

BASELINE = (
    "gyro_bias",
    "gyro_scale",
    "gyro_misalignment",
    "gyro_mass_unbalance",
    "accel_bias",
    "accel_scale",
    "accel_misalignment",
)


@pytest.fixture
def general_attitude():
    """An attitude with no zero and no symmetry in it: from the identity a wrong order of products passes."""
    return rotation_matrix(np.array([0.7, -1.1, 1.9]))


@pytest.fixture(scope="session")
def site() -> Site:
    return Site(latitude_rad=np.radians(36.4), height_m=80.0)


@pytest.fixture(scope="session")
def imu() -> ImuSpecification:
    """The specification of Kim, Song & Lyou."""
    return ImuSpecification(
        "paper",
        gyro_white_noise=to_si(0.1, "deg/h/sqrt(Hz)"),
        accel_white_noise=to_si(10, "ug/sqrt(Hz)"),
        prior={
            "gyro_bias": to_si(1, "deg/h"),
            "gyro_scale": to_si(150, "ppm"),
            "gyro_misalignment": to_si(1, "arcmin"),
            "gyro_mass_unbalance": to_si(1, "deg/h/g"),
            "accel_bias": to_si(150, "ug"),
            "accel_scale": to_si(150, "ppm"),
            "accel_misalignment": to_si(1, "arcmin"),
        },
    )


@pytest.fixture(scope="session")
def model() -> Model:
    return Model(BASELINE)


@pytest.fixture
def three_stops() -> Plan:
    """Three stops of 10 s with quick turns about two axes between them: 46 s."""
    turns = (Turn("X", np.radians(100.0), np.radians(25.0)), Turn("Z", np.radians(-80.0), np.radians(40.0)))
    return Plan("three stops", (10.0, 10.0, 10.0), turns, np.radians(200.0))


@pytest.fixture
def recorded_test(imu: ImuSpecification, site: Site) -> Callable[..., Recording]:
    """Simulate a plan on a table that turns about any axis: ``recorded_test(plan, seed=1, **scenario)``."""

    def make(plan: Plan, **options: object) -> Recording:
        table = TableSpecification(axes=None)
        return generate(Scenario(plan, imu, site, table=table, **options))[0]  # type: ignore[arg-type]

    return make


BENCH_SITE = Site(latitude_rad=float(np.radians(36.4)), height_m=80.0)


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

    def fit(self, seed: int = 101, effects: tuple[str, ...] = (), plan: str = "kim18_signed") -> NavigationFit:
        return _fit(seed, effects, plan)

    def diagnosis(self, seed: int = 101, effects: tuple[str, ...] = (), plan: str = "kim18_signed") -> Diagnosis:
        return _diagnosis(seed, effects, plan)


BENCH = Bench(BENCH_SITE, load_imu("dtg"), load_model("baseline"))


@cache
def _recording(seed: int, effects: tuple[str, ...], plan: str) -> Recording:
    scenario = Scenario(BENCH.plan(plan), BENCH.imu, BENCH.site, rate_hz=20.0, seed=seed, effects=effects)
    return generate(scenario)[0]


@cache
def _fit(seed: int, effects: tuple[str, ...], plan: str) -> NavigationFit:
    return solve(PreparedTest(_recording(seed, effects, plan), BENCH.imu, BENCH.site), BENCH.model)


@cache
def _diagnosis(seed: int, effects: tuple[str, ...], plan: str) -> Diagnosis:
    return climb(_fit(seed, effects, plan))


@pytest.fixture(scope="session")
def bench() -> Bench:
    return BENCH
