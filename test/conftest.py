"""What tests share: a domain of their own, a small recording, and the recordings that are not in the repository."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from sdimu_calibration.storage.bag_writer import write_recording

START_NS = 1_700_000_000_000_000_000
INTERVAL_NS = 10_000_000

# Every worker of a parallel run has DDS traffic of its own, on this machine only.
_WORKER = int("".join(filter(str.isdigit, os.environ.get("PYTEST_XDIST_WORKER", "0"))) or 0)
os.environ["ROS_DOMAIN_ID"] = str(40 + _WORKER % 60)
os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"


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
            start_ns=START_NS,
            imu_ns=self.ns,
            omega_ib_b=self.omega_ib_b,
            f_ib_b=self.f_ib_b,
            status=(self.slow_ns, self.dwell, self.stop),
            joint_states=(self.ns, self.names, self.angle, self.rate),
            temperature=(self.slow_ns, self.temperature),
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
