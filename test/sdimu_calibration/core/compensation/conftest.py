"""Results made by hand: coefficients of any size, without a calibration behind them."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import pytest

from sdimu_calibration.core.effects import selection
from sdimu_calibration.core.results import Calibration, no_history

BASELINE = (
    "gyro_bias",
    "gyro_scale",
    "gyro_misalignment",
    "gyro_mass_unbalance",
    "accel_bias",
    "accel_scale",
    "accel_misalignment",
)


def made(effects: Sequence[str], size: float = 1.0, seed: int = 1, **data: float) -> Calibration:
    """Draw a result: every coefficient `size` times a MEMS sigma, in the accelerometers' frame."""
    rng = np.random.default_rng(seed)
    found = [selection.resolve(name) for name in effects]
    parameters = [p for effect in found for p in effect.parameters]
    sigma = np.array([e.prior["mems"] for e in found for _ in e.parameters])
    values = size * sigma * rng.standard_normal(len(parameters))
    for k, p in enumerate(parameters):
        if p.name in {"accel_misalignment_xy", "accel_misalignment_xz", "accel_misalignment_yx"}:
            values[k] = 0.0
    root = 0.01 * sigma[:, None] * rng.standard_normal((len(parameters), len(parameters)))
    return Calibration(
        "accelerometer_triad",
        tuple(effects),
        tuple(p.name for p in parameters),
        tuple(p.unit for p in parameters),
        tuple(p.display_unit for p in parameters),
        values,
        root @ root.T,
        {},
        dict(data),
        (),
        no_history(len(parameters)),
    )


@pytest.fixture
def make_result() -> Callable[..., Calibration]:
    return made
