"""Error against mount misalignment, for the filter and for the classical estimator: the paper's claim, measured.

Every seed draws one IMU and one noise; the same IMU is then tested at every mount.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.batch.classical import TABLE_FRAME
from sdimu_calibration.core.effects import body_frame
from sdimu_calibration.core.estimation.outcome import calibrate
from sdimu_calibration.core.results import Calibration
from sdimu_calibration.core.specification import Model
from sdimu_sim.core.scenario import Scenario, generate
from sdimu_sim.core.truth import Truth, in_body_frame

Progress = Callable[[str, float], None]

FORMAT = "sdimu-mount-study/1"
ESTIMATORS = ("filter", "classical", "classical, turned afterwards")


def turned(result: Calibration, frame: str) -> Calibration:
    """Turn a result in the axes of the table into another body frame, exactly."""
    J = body_frame.jacobian_at(result.names, result.values, frame)
    values = body_frame.values_in_frame(result.names, result.values, frame)
    return replace(result, body_frame=frame, values=values, covariance=J @ result.covariance @ J.T)


def mount_study(
    scenario: Scenario, model: Model, mounts_deg: Sequence[float], seeds: Sequence[int], progress: Progress
) -> dict[str, Any]:
    """Calibrate simulated tests at several mounts.

    Parameters
    ----------
    scenario : Scenario
        Its seed and mount are replaced; a mount is the same angle about all three axes.
    model : Model
    mounts_deg : sequence of float
    seeds : sequence of int
    progress : callable
        Called with a word and the fraction done.

    Returns
    -------
    dict
        ``rms``: by estimator, by effect, RMS error (SI) over seeds and parameters at every mount; ``spread``: its
        standard error.
    """
    squares: dict[str, dict[str, list[list[float]]]] = {
        estimator: {effect: [[] for _ in mounts_deg] for effect in model.effects} for estimator in ESTIMATORS
    }
    total = len(mounts_deg) * len(seeds)
    for number in range(total):
        column, seed = number % len(mounts_deg), seeds[number // len(mounts_deg)]
        progress(f"mount {mounts_deg[column]:g} deg, seed {seed}", number / total)
        angle = float(np.radians(mounts_deg[column]))
        recording, truth = generate(replace(scenario, seed=seed, mount_rad=(angle, angle, angle)))
        what = recording, scenario.site, scenario.imu, model
        results = (
            calibrate(*what, held_out=False),
            classical := calibrate(*what, held_out=False, estimator="classical"),
            turned(classical, model.body_frame),
        )
        for estimator, result in zip(ESTIMATORS, results, strict=True):
            for effect, error in errors_by_effect(result, truth).items():
                squares[estimator][effect][column].append(float(np.mean(error**2)))
    each = {
        estimator: {effect: np.array(columns) for effect, columns in effects.items()}
        for estimator, effects in squares.items()
    }
    return {
        "format": FORMAT,
        "mount_deg": list(mounts_deg),
        "seeds": list(seeds),
        "rms": {e: {k: np.sqrt(v.mean(axis=1)) for k, v in effects.items()} for e, effects in each.items()},
        "spread": {e: {k: _standard_error(v) for k, v in effects.items()} for e, effects in each.items()},
    }


def errors_by_effect(result: Calibration, truth: Truth) -> dict[str, Floats]:
    """Estimate minus truth (SI) by effect; coefficients that the frame makes zero are left out.

    The classical result in table axes is held against the sensor as built, in its own axes: that these are the
    table's is what the method assumes.
    """
    true = in_body_frame(truth.imu.coefficients, "prior" if result.body_frame == TABLE_FRAME else result.body_frame)
    out: dict[str, Floats] = {}
    for effect in result.model:
        own = [i for i, name in enumerate(result.names) if name.startswith(f"{effect}_")]
        error = np.array([result.values[i] - true[result.names[i]] for i in own])
        out[effect] = error[error != 0.0]
    return out


def _standard_error(squares: Floats) -> Floats:
    """Take the standard error of the RMS from the scatter of the seeds' mean squares (mounts, seeds)."""
    count = squares.shape[1]
    of_mean = squares.std(axis=1, ddof=min(1, count - 1)) / np.sqrt(count)
    return np.asarray(of_mean / (2.0 * np.sqrt(squares.mean(axis=1))))
