"""A running test as a page sees it, without ROS."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from sdimu_calibration.core.units import to_si
from sdimu_calibration.report.live_page.record import LiveRecord
from sdimu_calibration.report.live_seen import Outline
from sdimu_calibration.report.live_text import Rows, SeenChoice, SeenDiagnosis, SeenFamily

BIAS, SCALE = to_si(1.0, "deg/h"), to_si(150.0, "ppm")
UNITS = {"gyro_bias_x": "deg/h", "gyro_scale_x": "ppm"}
TEST = Outline(900.0, 4, ("gyro_bias", "gyro_scale"), UNITS)
NIS = {"position": 1.2, "rate": 0.98}
NOT_YET = SeenDiagnosis()
MISFIT = SeenDiagnosis(
    3,
    "misfit",
    "2 candidates stand out of the noise, gyro_scale_asymmetry_y most.",
    "noise reaches 3.82",
    (("gyro_scale_asymmetry_y", "+27.4 sigma, 41 ppm"), ("gyro_bias_step_y(t0=300 s)", "+12.1 sigma, 3 deg/h")),
    (("as given", "2.42"), ("+ gyro_scale_asymmetry_y", "0.98")),
    ("gyro_x", "gyro_y"),
    ("0", "1", "2", "3"),
    np.array([[0.4, -4.2, 0.1, np.nan], [0.0, 1.0, 11.7, -2.9]]),
    standing=2,
)
DRIFT = SeenFamily("Slow change of the bias, gyro y", 0.97, (("gyro_bias_step_y(t0=300 s)", 0.6), ("warm_up", 0.37)))


@dataclass
class Now:
    """What `nodes.monitor.Progress` has."""

    stop: int = 1
    phase: str = "dwell"
    table_s: float = 300.0
    filter_s: float = 290.0
    sigmas: dict[str, float] = field(default_factory=lambda: {"gyro_bias_x": 0.01 * BIAS, "gyro_scale_x": 0.5 * SCALE})
    first: dict[str, float] = field(default_factory=lambda: {"gyro_bias_x": BIAS, "gyro_scale_x": SCALE})
    nis: dict[str, float] = field(default_factory=lambda: dict(NIS))
    verdict: str = "consistent"
    diagnosis: SeenDiagnosis = NOT_YET
    nis_by_stop: dict[int, dict[str, float]] = field(default_factory=lambda: {0: dict(NIS), 1: dict(NIS)})
    ladders: dict[int, Rows] = field(default_factory=dict)
    choices: list[SeenChoice] = field(default_factory=list)


def record_of(*seen: Now) -> LiveRecord:
    """Return the record of what was seen one after the other, 3 s of wall time after the first sample."""
    record = LiveRecord(TEST, "out/run")
    for now in seen:
        record.take(now, True, 3.0)
    return record
