"""One run of the campaign on hidden effects: draw, simulate, diagnose blindly, then score by name."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from sdimu_calibration.core.diagnosis.diagnose import diagnose
from sdimu_calibration.core.recording import Recording
from sdimu_calibration.core.specification import ImuSpecification, Model, Site
from sdimu_calibration.storage.files.config import load_plan
from sdimu_sim.core.scenario import Scenario, imu_truth
from sdimu_sim.core.truth import child_rng
from sdimu_study.hidden_draw import Draw, draw, hideable_names
from sdimu_study.hidden_score import score
from sdimu_study.hidden_sizes import RATE_HZ, WARM_UP, Sizes
from sdimu_study.run import in_the_mean, simulate

WRONG_DENSITY = 1.3
"""Noise of the sensor over its specification, where that is the fault."""
_OUTLIER_SIGMAS = 20.0


@dataclass(frozen=True)
class HiddenRun:
    """Simulate a drawn test, diagnose it and score the diagnosis.

    Attributes
    ----------
    kind : str
        One of `sdimu_study.hidden_draw.KINDS`.
    imu : ImuSpecification
    model : Model
        The baseline that is to be found wanting.
    tables : tuple of Sizes
        How small an effect each plan can see.
    """

    kind: str
    imu: ImuSpecification
    model: Model
    tables: tuple[Sizes, ...]

    def __call__(self, seed: int) -> dict[str, Any]:
        """Run a seed; the row is that of `sdimu_study.hidden_score.score`.

        Raises
        ------
        DataError
            When the drawn test cannot be simulated or calibrated.
        """
        drawn = draw(self.kind, seed, self.tables, hideable_names())
        scenario = scenario_of(drawn, self.imu, seed)
        sensor = imu_truth(scenario)
        recording = with_fault(simulate(scenario, sensor), drawn, self.imu, seed)
        found = diagnose(recording, scenario.site, self.imu, self.model)
        # From here on the truth is known; nothing before this line has seen it.
        return score(drawn, found, in_the_mean(sensor, recording, seed))


def scenario_of(drawn: Draw, imu: ImuSpecification, seed: int) -> Scenario:
    """Scenario of a draw; wrong densities are put into the sensor, not into the specification it is judged by."""
    true = imu
    if drawn.fault.startswith("gyro noise"):
        true = replace(imu, gyro_white_noise=WRONG_DENSITY * imu.gyro_white_noise)
    elif drawn.fault.startswith("accel noise"):
        true = replace(imu, accel_white_noise=WRONG_DENSITY * imu.accel_white_noise)
    return Scenario(
        plan=load_plan(drawn.plan), imu=true, site=Site(math.radians(drawn.latitude_deg), 0.0), rate_hz=RATE_HZ,
        seed=seed, effects=tuple(t.text for t in drawn.truths), temperature=WARM_UP,
    )  # fmt: skip


def with_fault(recording: Recording, drawn: Draw, imu: ImuSpecification, seed: int) -> Recording:
    """Add outliers of 20 sample sigmas, either sign, to a share of the samples, where that is the fault."""
    if not drawn.fault.startswith("outliers"):
        return recording
    share = float(drawn.fault.split()[1]) / 100.0
    rng = child_rng(seed, "outliers")
    hit = rng.random(len(recording.t)) < share
    sign = rng.choice((-1.0, 1.0), size=(len(recording.t), 6)) * hit[:, None]
    size = _OUTLIER_SIGMAS / np.sqrt(recording.interval_s)
    return replace(
        recording,
        omega_ib_b=recording.omega_ib_b + sign[:, :3] * size * imu.gyro_white_noise,
        f_ib_b=recording.f_ib_b + sign[:, 3:] * size * imu.accel_white_noise,
    )
