"""What tests share: a domain of their own, recordings, a diagnosis with a hidden effect, results of a batch."""

from __future__ import annotations

import gc
import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from sharing import DOMAINS_A_RUN, longest_first, sharing
from tiers import COLLECTED, is_thorough

from sdimu_calibration.core.diagnosis.diagnose import Diagnosis, diagnose
from sdimu_calibration.core.effects import registry
from sdimu_calibration.core.origin import Origin
from sdimu_calibration.core.recording import Recording
from sdimu_calibration.core.results import Calibration, no_history
from sdimu_calibration.core.units import to_si
from sdimu_calibration.report.report_extras import ReportExtras
from sdimu_calibration.storage.bags.bag_writer import BagContent, write_recording
from sdimu_calibration.storage.files.config import load_imu, load_model, load_site
from sdimu_calibration.storage.files.result_file import write_result

START_NS = 1_700_000_000_000_000_000
INTERVAL_NS = 10_000_000

# As the shell does (cli/start.py): half a million objects of modules and tests are none of the garbage that is sought.
gc.set_threshold(50_000, 20, 50)

# Every worker of a parallel run has DDS traffic of its own, on this machine only; a run beside another one begins at
# another domain. Domains 215 to 232 have ports beyond those that Linux gives to clients, and `sdimu run` takes none of
# them unless it is told to.
_WORKER = int("".join(filter(str.isdigit, os.environ.get("PYTEST_XDIST_WORKER", "0"))) or 0)
os.environ["ROS_DOMAIN_ID"] = str(int(os.environ.get("SDIMU_FIRST_DOMAIN", "215")) + _WORKER % DOMAINS_A_RUN)
os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Mark what `make test` leaves to `.ci/run`."""
    config.stash[COLLECTED] = [item.nodeid for item in items]
    for item in items:
        if is_thorough(item.nodeid, over_dds=item.get_closest_marker("ros") is not None):
            item.add_marker("thorough")
    items[:] = longest_first(items)


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> object:
    """Share out the tests of a parallel run, where files stay together, as `sharing` says."""
    return sharing(config, log) if config.getvalue("dist") == "loadfile" else None


class SmallTest:
    """Arrays of a short test at 100 Hz with all topics, with numbers that no two places share."""

    def __init__(self, n: int = 500) -> None:
        generator = np.random.default_rng(20240607)
        self.ns = (np.arange(n, dtype=np.int64) + 1) * INTERVAL_NS
        self.omega_ib_b = generator.standard_normal((n, 3))
        self.f_ib_b = generator.standard_normal((n, 3)) * 10.0
        self.slow_ns = np.arange(0, n * INTERVAL_NS, 1_000_000_000, dtype=np.int64)
        self.dwell = np.arange(len(self.slow_ns)) % 3 != 2
        self.stop = np.arange(len(self.slow_ns), dtype=np.int64) // 3
        self.names = ("outer", "middle", "inner")
        self.angle = generator.standard_normal((n, 3))
        self.rate = generator.standard_normal((n, 3))
        self.temperature = 20.0 + generator.standard_normal(len(self.slow_ns))

    def write(self, path: Path) -> Path:
        """Write all of it to a bag; return its folder."""
        write_recording(
            path,
            BagContent(
                start_ns=START_NS,
                imu_ns=self.ns,
                omega_ib_b=self.omega_ib_b,
                f_ib_b=self.f_ib_b,
                status=(self.slow_ns, self.dwell, self.stop),
                joint_states=(self.ns, self.names, self.angle, self.rate),
                temperature=(self.slow_ns, self.temperature),
            ),
        )
        return path


@pytest.fixture
def small_test() -> SmallTest:
    return SmallTest()


@pytest.fixture
def bag(tmp_path: Path, small_test: SmallTest) -> Path:
    """Folder of a bag with the small test."""
    return small_test.write(tmp_path / "small")


@pytest.fixture
def recorded() -> Callable[[str], Path]:
    """Find a recording that is not part of the repository, or skip.

    The environment variable SDIMU_RECORDINGS names the folder that holds them.
    """

    def find(name: str) -> Path:
        folder = os.environ.get("SDIMU_RECORDINGS")
        path = Path(folder or "recordings") / name
        if not path.exists():
            pytest.skip(f"recording {name} is not here (set SDIMU_RECORDINGS to the folder of the recordings)")
        return path

    return find


EFFECTS = ("gyro_bias", "gyro_scale", "accel_bias", "accel_scale")
DAY_NS = 86_400 * 10**9


def draw(rng: np.random.Generator, own: np.ndarray, effects: tuple[str, ...] = EFFECTS) -> Calibration:
    """A result: values of a unit, in its prior's sigmas, a hundredth of which is the error."""
    parameters = [p for name in effects for p in registry.get(name).parameters]
    size = np.array([registry.get(name).prior["navigation"] for name in effects for _ in registry.get(name).parameters])
    sigma = 0.01 * size
    return Calibration(
        "accelerometer_triad",
        effects,
        tuple(p.name for p in parameters),
        tuple(p.unit for p in parameters),
        tuple(p.display_unit for p in parameters),
        size * own + sigma * rng.standard_normal(len(size)),
        np.diag(sigma**2),
        {"nis_mean": 1.0},
        {"samples": 1000.0, "duration_s": 60.0},
        (),
        no_history(len(size)),
    )


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
                    f"SN{unit}",
                    str(power_on),
                    10**18 + (10 * unit + power_on) * DAY_NS,
                    21.0 + power_on,
                    20.0,
                    25.0,
                    to_si(2.0, "deg/s"),
                    f"bag_{unit}_{power_on}",
                    "dtg",
                    "daejeon",
                )
                folder = tmp_path / "batch" / f"unit{unit}_{power_on}"
                write_result(folder / "result.json", replace(result, origin=origin))
        return tmp_path / "batch"

    return make


@pytest.fixture(scope="session")
def recording() -> Recording:
    """Of the quick plan, with a hidden effect."""
    # The tests of the table run where simulated IMU and studies are not installed.
    from plans import hidden_recording, quick_plan

    return hidden_recording(quick_plan())


@pytest.fixture(scope="session")
def diagnosis(recording: Recording) -> Diagnosis:
    return diagnose(recording, load_site("daejeon"), load_imu("dtg"), load_model("baseline"))


@pytest.fixture(scope="session")
def more(recording: Recording, diagnosis: Diagnosis) -> ReportExtras:
    from plans import with_angles

    return with_angles(diagnosis, recording)
