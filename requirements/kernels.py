"""Compile the loops that a simulated test, its calibration and its diagnosis need, as their first use would.

``requirements/install.py`` starts this twice as soon as numba is there, while the packages of ROS are fetched:
``kernels.py filter`` compiles the pass of the filter, two thirds of the time, ``kernels.py others`` what needs no pass.
Both together keep two processors busy for half a minute; what is compiled already costs nothing. Whoever needs a loop
that is not done yet waits for it, or compiles it.
"""

from __future__ import annotations

import math
import sys
import tempfile
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT / "src" / name) for name in ("sdimu_calibration", "rate_table_sim", "sdimu_sim")]

import sdimu_calibration  # noqa: E402, F401, I001  (before numpy: one thread of linear algebra)
import numpy as np  # noqa: E402

from sdimu_calibration.core.data.axes_and_units import Stated  # noqa: E402
from sdimu_calibration.core.diagnosis.diagnose import climb  # noqa: E402
from sdimu_calibration.core.estimation.solve import solve  # noqa: E402
from sdimu_calibration.core.evidence.signatures import Epochs, Regressors, constant_signatures, signatures  # noqa: E402
from sdimu_calibration.core.filter import filter_pass  # noqa: E402
from sdimu_calibration.core.filter.filter_pass import COPY, MEASURED, NAV, PassState, new_output  # noqa: E402
from sdimu_calibration.core.filter.kalman import update  # noqa: E402
from sdimu_calibration.core.filter.pass_setup import pass_settings  # noqa: E402
from sdimu_calibration.core.live import LiveCalibration  # noqa: E402
from sdimu_calibration.core.navigation import strapdown  # noqa: E402
from sdimu_calibration.core.plan import Plan, Turn  # noqa: E402
from sdimu_calibration.core.units import STANDARD_GRAVITY  # noqa: E402
from sdimu_calibration.storage.bags.bag_reader import read_recording  # noqa: E402
from sdimu_calibration.storage.files.config import load_imu, load_model, load_site  # noqa: E402
from sdimu_calibration.storage.files.journal_walk import raw_test  # noqa: E402
from sdimu_calibration.storage.opening import Source, open_test, opening_options  # noqa: E402
from sdimu_sim.bag_file import write_test  # noqa: E402
from sdimu_sim.core.scenario import Scenario, simulate_test  # noqa: E402

TURNS = tuple(Turn(axis, 0.5 * math.pi, 0.5) for axis in "YZXYZX")
PLAN = Plan("short", (20.0,) * 7, TURNS, 1.0)
"""As short as a test can be that is fitted and diagnosed (s, rad, rad/s, rad/s^2)."""
REST_NS = np.arange(1, 401) * 100_000_000
"""Stamps of samples at rest (ns): 40 s at 10 Hz, enough to find the attitude and to filter."""


def at_rest() -> LiveCalibration:
    """Begin a test whose table rests."""
    options = replace(opening_options("daejeon", load_imu("dtg"), Source()), stated=Stated(1.0, 1.0, 1, 1))
    live = LiveCalibration(options, load_model("baseline"))
    live.add_phase(0, True, 0)
    rate, force = np.full((len(REST_NS), 3), 4e-5), np.tile([0.0, 0.0, -STANDARD_GRAVITY], (len(REST_NS), 1))
    live.add_samples(REST_NS, rate, force)
    return live


def filter_loops() -> None:
    """Let the filter of a running test take samples."""
    at_rest().advance(int(REST_NS[-1]), True)


def parts_of_the_pass() -> None:
    """Call with zeros what the pass of the filter comes to last: the other process needs 20 s until then."""
    p = 1
    s = NAV + p + COPY
    x, P, z, S = np.zeros(s), np.eye(s), np.zeros(MEASURED), np.eye(MEASURED)
    settings = pass_settings(at_rest().setup)
    state = PassState(x, P, np.eye(3), np.zeros(3), np.zeros(3), np.zeros(p))
    _, H, R, M = filter_pass._measurement(settings, state, np.zeros((6, p)), np.zeros(6), 1.0, p, 1.0)
    update(x, P, z, H, R, M)
    filter_pass._feed_back(settings, state)
    filter_pass._write(new_output(1, p, True, 1), 0, 0, z, S[:, 0], S)


def without_a_pass() -> None:
    """Call loops that in a test come after the filter, with zeros: waiting for it would leave a processor idle."""
    zeros, one, few = np.zeros((1, 3)), np.ones(1), np.zeros(1, dtype=np.int64)
    epochs, output = Epochs(few, few + 1, few), new_output(1, 1, True, 1)
    seen = SimpleNamespace(t=one, C_nb=np.zeros((1, 3, 3)), f=zeros, dt=one)
    signatures(seen, epochs, output, Regressors(np.zeros((1, 1)), few, few), 0.0, None, np.zeros((2, 2), order="F"))
    constant_signatures(seen, epochs, output, one, one, 0.0, None, np.zeros((2, 6), order="F"))
    strapdown._navigate(np.eye(3), strapdown.Steps(zeros, zeros, zeros, zeros, one), 0.0, 0.0, 0.0, level=True)
    raw_test(np.zeros(0, np.uint8), 0)


def other_loops() -> None:
    """Simulate, write and read; then fit and diagnose, which finds the loops of the filter done, or waits for them."""
    site, imu, model = load_site("daejeon"), load_imu("dtg"), load_model("baseline")
    scenario = Scenario(PLAN, imu, site, seed=1)
    test = simulate_test(scenario)
    parts_of_the_pass()
    with tempfile.TemporaryDirectory() as folder:
        bag = Path(folder) / "bag"
        write_test(bag, scenario, test)
        read_recording(bag)
        without_a_pass()
        climb(solve(open_test(bag, "daejeon", imu), model))


PARTS = {"filter": filter_loops, "others": other_loops}
"""What can be asked for, each in a process of its own."""


if __name__ == "__main__":
    PARTS[sys.argv[1]]()
