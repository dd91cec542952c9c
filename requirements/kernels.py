"""Compile the loops that a simulated test, its calibration and its diagnosis need, as their first use would.

``requirements/install.py`` starts this as soon as numba is there, while the packages of ROS are fetched. A minute of a
processor; what is compiled already costs nothing. It ends without a word where something is amiss: whoever needs a loop
compiles it.
"""

from __future__ import annotations

import math
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT / "src" / name) for name in ("sdimu_calibration", "rate_table_sim", "sdimu_sim")]

import sdimu_calibration  # noqa: E402, F401  (before numpy: one thread of linear algebra)
from sdimu_calibration.core.diagnosis.diagnose import climb  # noqa: E402
from sdimu_calibration.core.estimation.solve import solve  # noqa: E402
from sdimu_calibration.core.live import LiveCalibration  # noqa: E402
from sdimu_calibration.core.plan import Plan, Turn  # noqa: E402
from sdimu_calibration.storage.bags.bag_reader import read_recording  # noqa: E402
from sdimu_calibration.storage.files.config import load_imu, load_model, load_site  # noqa: E402
from sdimu_calibration.storage.opening import Source, open_test, opening_options  # noqa: E402
from sdimu_sim.bag_file import write_test  # noqa: E402
from sdimu_sim.core.scenario import Scenario, simulate_test  # noqa: E402

TURNS = tuple(Turn(axis, 0.5 * math.pi, 0.5) for axis in "YZXYZX")
PLAN = Plan("short", (20.0,) * 7, TURNS, 1.0)
"""As short as a test can be that is fitted and diagnosed (s, rad, rad/s, rad/s^2)."""


def main() -> None:
    """Simulate, feed the live filter, write, read, fit, diagnose."""
    site, imu, model = load_site("daejeon"), load_imu("dtg"), load_model("baseline")
    scenario = Scenario(PLAN, imu, site, seed=1)
    test = simulate_test(scenario)
    live = LiveCalibration(opening_options("daejeon", imu, Source()), model)
    live.add_samples(test.samples.ns, test.samples.omega_ib_b, test.samples.f_ib_b)
    with tempfile.TemporaryDirectory() as folder:
        bag = Path(folder) / "bag"
        write_test(bag, scenario, test)
        log = read_recording(bag).phase
        for t, dwell, stop in zip(log.t, log.dwell, log.stop, strict=True):
            live.add_phase(int(test.samples.ns[0]) + round(float(t) * 1e9), bool(dwell), int(stop))
        climb(solve(open_test(bag, "daejeon", imu), model))


if __name__ == "__main__":
    main()
