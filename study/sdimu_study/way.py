"""The filter on the way of a test on a table: do its sigmas hold after some stops, in flicker and in white noise."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from sdimu_calibration.core.data.axes_and_units import Stated
from sdimu_calibration.core.front_door import OpeningOptions
from sdimu_calibration.core.live import NS, EpochEstimate, LiveCalibration
from sdimu_calibration.core.recording import Recording
from sdimu_calibration.core.specification import ImuSpecification, Model, Site
from sdimu_calibration.storage.files.config import load_imu
from sdimu_sim.core.mean_bias import BIASES, mean_bias
from sdimu_sim.core.truth import ImuTruth
from sdimu_study.hand import stated_instability
from sdimu_study.study import Group, Key, Study
from sdimu_study.worlds import model_of, simulated_recording, true_values

WHITE, FLICKER = "white", "flicker"
NOISES = (WHITE, FLICKER)
"""Noise beside white noise, of the simulated sensors as the IMU file states it: none, or its bias instability."""
PLAN = "kim18"
STOPS = (3, 6, 12, 18)
"""Turns after which the estimate at the end of the stop is judged."""
_SITE = Site(math.radians(36.4), 0.0)
_PIECE_S = 10.0
"""Length of the pieces in which samples come (s): the estimates do not depend on it."""


@dataclass(frozen=True)
class Way:
    """A test that is fed to the filter on the way, and its truth."""

    recording: Recording
    imu: ImuSpecification
    model: Model
    sensor: ImuTruth
    seed: int


def world(case: Key, seed: int) -> Way:
    """Simulate a test: IMU file, noise."""
    name, noise = case
    imu = load_imu(name)
    if noise == WHITE:
        imu = replace(imu, gyro_bias_instability=0.0, accel_bias_instability=0.0)
    terms = stated_instability(imu)
    recording, sensor = simulated_recording(imu, PLAN, _SITE, seed, (), terms)
    return Way(recording, imu, model_of(name), sensor, seed)


def run(world: Way) -> dict[int, EpochEstimate]:
    """Feed a test as it goes on; of each stop keep what the filter knew at its end."""
    recording, log = world.recording, world.recording.phase
    assert log is not None
    live = LiveCalibration(OpeningOptions(world.imu, _SITE, stated=Stated(1.0, 1.0, 1, 1)), world.model)
    ns = recording.start_ns + np.rint(recording.t * NS).astype(np.int64)
    for t, dwell, stop in zip(log.t.tolist(), log.dwell.tolist(), log.stop.tolist(), strict=True):
        live.add_phase(recording.start_ns + round(t * NS), dwell, stop)
    step = round(_PIECE_S / recording.interval_s)
    last: dict[int, EpochEstimate] = {}
    for first in range(0, len(ns), step):
        rows = slice(first, first + step)
        live.add_samples(ns[rows], recording.omega_ib_b[rows], recording.f_ib_b[rows])
        last |= {one.stop: one for one in live.advance(int(ns[rows][-1])) if one.dwell}
    return last


def score(world: Way, found: dict[int, EpochEstimate]) -> dict[str, Any]:
    """Sum of squares and number of the errors over sigma of biases and of all others, after each of `STOPS`."""
    return {"stops": {str(k): _errors(world, found[k]) for k in STOPS}}


def _errors(world: Way, at: EpochEstimate) -> dict[str, Any]:
    """Biases in the mean over the rests so far."""
    recording = world.recording
    assert recording.phase is not None
    so_far = recording.t[recording.t <= at.t + 1e-6]
    mean = mean_bias(world.sensor, so_far, recording.phase, recording.interval_s, world.seed)
    sensor = replace(world.sensor, coefficients={**world.sensor.coefficients, **mean})
    sigma = np.sqrt(np.diag(at.covariance))
    free = sigma > 0.0
    z = (at.coefficients - true_values(sensor, at.names, at.body_frame))[free] / sigma[free]
    bias = np.isin(np.array(at.names)[free], BIASES)
    kinds = {"others": z[~bias], "biases": z[bias]}
    return {kind: {"z2": float(np.sum(of**2)), "count": len(of)} for kind, of in kinds.items()} | {
        "largest_z": float(np.max(np.abs(z)))
    }


def _rms(stop: int) -> Callable[[Group], str]:
    """RMS of the errors over sigma after a stop: all other coefficients, biases."""

    def cell(group: Group) -> str:
        rows = [row["stops"][str(stop)] for row in group.good]
        totals = [(sum(r[k]["z2"] for r in rows), sum(r[k]["count"] for r in rows)) for k in ("others", "biases")]
        return ", ".join(f"{math.sqrt(z2 / max(count, 1)):.2f}" for z2, count in totals)

    return cell


def _largest(group: Group) -> str:
    return f"{max((row['stops'][str(STOPS[-1])]['largest_z'] for row in group.good), default=0.0):.1f}"


STUDY = Study(
    "way",
    world,
    run,
    score,
    (
        ("IMU file", lambda g: g.key[0]),
        ("noise", lambda g: " ".join(g.key[1:])),
        ("runs", lambda g: str(len(g.rows))),
        ("refused", lambda g: str(len(g.rows) - len(g.good))),
        *((f"after {stop} stops: others, biases", _rms(stop)) for stop in STOPS),
        (f"largest z after {STOPS[-1]}", _largest),
    ),
)
