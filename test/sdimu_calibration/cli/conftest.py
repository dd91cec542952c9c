"""Folders of results of a type, made from nothing but numbers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sdimu_calibration.core.effects import registry
from sdimu_calibration.core.origin import Origin
from sdimu_calibration.core.results import Calibration, no_history
from sdimu_calibration.core.units import to_si
from sdimu_calibration.storage.result_file import write_result

EFFECTS = ("gyro_bias", "gyro_scale", "accel_bias", "accel_scale")
DAY_NS = 86_400 * 10**9


def draw(rng: np.random.Generator, own: np.ndarray, effects: tuple[str, ...] = EFFECTS) -> Calibration:
    """A result: values of a unit, in its prior's sigmas, a hundredth of which is the error."""
    parameters = [p for name in effects for p in registry.get(name).parameters]
    size = np.array([registry.get(name).prior["navigation"] for name in effects for _ in registry.get(name).parameters])
    sigma = 0.01 * size
    return Calibration(
        "accelerometer_triad", effects, tuple(p.name for p in parameters), tuple(p.unit for p in parameters),
        tuple(p.display_unit for p in parameters), size * own + sigma * rng.standard_normal(len(size)),
        np.diag(sigma**2), {"nis_mean": 1.0}, {"samples": 1000.0, "duration_s": 60.0}, (), no_history(len(size)),
    )  # fmt: skip


@pytest.fixture
def batch(tmp_path: Path) -> Callable[..., Path]:
    """Make a folder of results of some units; the biases of a unit change with each power-on."""

    def make(units: int = 8, each: int = 1, out: int | None = None, seed: int = 1, turn_on: float = 0.1) -> Path:
        rng = np.random.default_rng(seed)
        biases = np.array([name.endswith("bias") for name in EFFECTS for _ in "xyz"])
        for unit in range(units):
            own = rng.standard_normal(len(biases))
            if unit == out:
                own[list(EFFECTS).index("gyro_scale") * 3 + 1] += 30.0
            for power_on in range(each):
                result = draw(rng, own + turn_on * biases * rng.standard_normal(len(biases)))
                origin = Origin(
                    f"SN{unit}", str(power_on), 10**18 + (10 * unit + power_on) * DAY_NS, 21.0 + power_on, 20.0, 25.0,
                    to_si(2.0, "deg/s"), f"bag_{unit}_{power_on}", "dtg", "daejeon",
                )  # fmt: skip
                folder = tmp_path / "batch" / f"unit{unit}_{power_on}"
                write_result(folder / "result.json", replace(result, origin=origin))
        return tmp_path / "batch"

    return make
