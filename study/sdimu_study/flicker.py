"""Cheap IMUs in the flicker of their data sheets and in more: do the sigmas of a calibration hold."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from sdimu_calibration.core.estimation.outcome import outcome
from sdimu_calibration.core.estimation.solve import solve
from sdimu_calibration.core.results import Calibration
from sdimu_calibration.storage.files.config import load_imu
from sdimu_study.hand import stated_instability
from sdimu_study.score import errors
from sdimu_study.study import Group, Key, Study, largest_z, rms_cell
from sdimu_study.worlds import OneTest, drawn_site, model_of, place_told, rng_of, simulated_test

IMUS = ("mems_industrial", "mems_consumer")
TIMES = ("once", "three times")
"""Flicker, in the bias instability that the IMU file states."""
PLANS = ("kim18", "kim18_10_min")
RATES = ("50 Hz", "200 Hz")
CASES: dict[Key, Key] = {key: key for key in ((i, t, p, r) for i in IMUS for t in TIMES for p in PLANS for r in RATES)}


def world(case: Key, seed: int) -> OneTest:
    """Simulate a test in flicker at a latitude that is drawn: IMU file, size, plan, samples a second."""
    name, times, plan, rate = case
    imu, site = load_imu(name), drawn_site(rng_of(seed, "flicker", *case))
    factor = 3.0 if times == "three times" else 1.0
    louder = replace(
        imu,
        gyro_bias_instability=factor * imu.gyro_bias_instability,
        accel_bias_instability=factor * imu.accel_bias_instability,
    )
    test, sensor = simulated_test(
        name, imu, plan, site, seed, (), stated_instability(louder), float(rate.removesuffix(" Hz"))
    )
    return OneTest(test, model_of(name), sensor, (), place_told(plan, site))


def run(world: OneTest) -> Calibration:
    """Calibrate, in the noise that is learned."""
    return outcome(solve(world.test, world.model))


def score(world: OneTest, found: Calibration) -> dict[str, Any]:
    """Errors over sigma of all coefficients that the body frame leaves free, and how well the model fits."""
    return dict(world.told) | errors(found, world.sensor) | {"noise": [str(t) for t in found.noise], "fit": found.fit}


def _varied(k: int) -> Callable[[Group], str]:
    """Give the word `k` of a key; the line of all runs has the first alone."""
    return lambda group: group.key[k] if k < len(group.key) else ""


STUDY = Study(
    "flicker",
    world,
    run,
    score,
    (
        *((word, _varied(k)) for k, word in enumerate(("IMU file", "flicker", "plan", "rate"))),
        ("runs", lambda g: str(len(g.rows))),
        ("refused", lambda g: str(len(g.rows) - len(g.good))),
        ("RMS z", lambda g: rms_cell(g.good)),
        ("largest z", lambda g: largest_z(g.good)),
    ),
)
