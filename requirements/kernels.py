"""Compile the loops that a simulated test, its calibration and its diagnosis need, as their first use would.

``requirements/install.py`` starts this as soon as numba is there, while the packages of ROS are fetched: two processes,
since the loops take more than a minute of one processor. ``kernels.py fit`` fits and diagnoses a predicted recording;
``kernels.py simulate`` compiles what the filter's pass calls, before the other one comes to it, and then simulates.
What is compiled already costs nothing. It ends without a word where something is amiss: whoever needs a loop compiles
it.
"""

from __future__ import annotations

import math
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT / "src" / name) for name in ("sdimu_calibration", "rate_table_sim", "sdimu_sim")]

# isort: off
import sdimu_calibration  # noqa: E402, F401  (before numpy: one thread of linear algebra)

# isort: on
import numpy as np  # noqa: E402
from numba import float64  # noqa: E402

from sdimu_calibration.core.diagnosis.diagnose import climb  # noqa: E402
from sdimu_calibration.core.estimation.prepared_test import PreparedTest  # noqa: E402
from sdimu_calibration.core.estimation.solve import solve  # noqa: E402
from sdimu_calibration.core.filter import kalman  # noqa: E402
from sdimu_calibration.core.live import LiveCalibration  # noqa: E402
from sdimu_calibration.core.navigation import ins_errors  # noqa: E402
from sdimu_calibration.core.plan import Plan, Turn  # noqa: E402
from sdimu_calibration.core.planning.nominal import nominal_recording  # noqa: E402
from sdimu_calibration.storage.bags.bag_reader import read_recording  # noqa: E402
from sdimu_calibration.storage.files.config import load_imu, load_model, load_site  # noqa: E402
from sdimu_calibration.storage.opening import Source, opening_options  # noqa: E402
from sdimu_sim.bag_file import write_test  # noqa: E402
from sdimu_sim.core.scenario import Scenario, simulate_test  # noqa: E402

TURNS = tuple(Turn(axis, 0.5 * math.pi, 0.5) for axis in "YZXYZX")
PLAN = Plan("short", (20.0,) * 7, TURNS, 1.0)
"""As short as a test can be that is fitted and diagnosed (s, rad, rad/s, rad/s^2)."""

_ROW, _MATRIX = float64[::1], float64[:, ::1]
PARTS = (
    (kalman.propagate, (_ROW, _MATRIX, _MATRIX, _MATRIX, _MATRIX, _ROW, _ROW)),
    (kalman.update, (_ROW, _MATRIX, _ROW, _MATRIX, _MATRIX, _MATRIX)),
    (ins_errors.process_noise, (_MATRIX, _MATRIX, _ROW, float64)),
    (ins_errors.navigation_error_matrix, (_ROW, _ROW, _ROW)),
)
"""The longest loops that the filter's pass calls with plain arrays, and the types with which it does."""


def fit() -> None:
    """Fit and diagnose."""
    site, imu = load_site("daejeon"), load_imu("dtg")
    perfect, noise = nominal_recording(PLAN, site), np.random.default_rng(1)
    n, each = len(perfect.t), perfect.interval_s**-0.5
    # Without noise the filter would be given the noise that was measured: none.
    recording = replace(
        perfect,
        omega_ib_b=perfect.omega_ib_b + imu.gyro_white_noise * each * noise.standard_normal((n, 3)),
        f_ib_b=perfect.f_ib_b + imu.accel_white_noise * each * noise.standard_normal((n, 3)),
    )
    climb(solve(PreparedTest(recording, imu, site), load_model("baseline")))


def simulate() -> None:
    """Compile parts of the filter, simulate, write, read, feed the live filter."""
    for function, types in PARTS:
        function.compile(types)
    site, imu, model = load_site("daejeon"), load_imu("dtg"), load_model("baseline")
    scenario = Scenario(PLAN, imu, site, seed=1)
    test = simulate_test(scenario)
    with tempfile.TemporaryDirectory() as folder:
        write_test(Path(folder) / "bag", scenario, test)
        log = read_recording(Path(folder) / "bag").phase
    live = LiveCalibration(opening_options("daejeon", imu, Source()), model)
    live.add_samples(test.samples.ns, test.samples.omega_ib_b, test.samples.f_ib_b)
    for t, dwell, stop in zip(log.t, log.dwell, log.stop, strict=True):
        live.add_phase(int(test.samples.ns[0]) + round(float(t) * 1e9), bool(dwell), int(stop))


if __name__ == "__main__":
    parts = {"fit": fit, "simulate": simulate}
    for part in sys.argv[1:] or parts:
        parts[part]()
