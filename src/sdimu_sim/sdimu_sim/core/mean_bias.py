"""The biases of a true sensor in the mean over the dwells of a test: constants, drifts and wandering noise together."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.recording import PhaseLog
from sdimu_sim.core.coloured import ColouredNoise
from sdimu_sim.core.equation import CONSTANTS
from sdimu_sim.core.hidden import parse_effects
from sdimu_sim.core.truth import COEFFICIENTS, ImuTruth

BIASES = tuple(name for name in COEFFICIENTS if "_bias_" in name)
"""Name of the bias of each sensor, in the order of every array of six."""


def mean_bias(truth: ImuTruth, t: Floats, phase: PhaseLog, interval_s: float, seed: int) -> Mapping[str, float]:
    """Biases in the mean over all dwells.

    `t`, shape (m,): stamps of the samples (s); `phase`: when the table stands. Gives the biases (SI) by name; empty
    where they are constants.
    """
    drifts = [e for e in parse_effects(truth.effects).terms if e.expression.names <= {"t", *e.parameters, *CONSTANTS}]
    drifts = [e for e in drifts if "t" in e.expression.names and ":" not in e.name]
    if not drifts and not truth.noise:
        return {}
    middle = t - 0.5 * interval_s
    rest = np.asarray(phase.dwell)[np.clip(np.searchsorted(phase.t, middle, side="right") - 1, 0, None)].astype(bool)
    wander = np.zeros((6, len(t)))
    ColouredNoise(truth.noise, interval_s, seed).add(wander, ~rest)
    for effect in drifts:
        wander[effect.sensor] += effect.expression.evaluate({**CONSTANTS, "t": middle, **effect.parameters})
    means = wander[:, rest].mean(axis=1)
    return {n: truth.coefficients.get(n, 0.0) + float(m) for n, m in zip(BIASES, means, strict=True)}
