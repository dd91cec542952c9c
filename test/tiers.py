"""Which tests `make test` leaves to `.ci/run` (`make thorough`), and why: what takes long, or another program.

Everything else runs in both. A row that names nothing fails test_tiers.py.
"""

from __future__ import annotations

THOROUGH = {
    "test/book/test_blocks.py": "runs README and tutorials as they stand",
    "test/browser": "drives Chromium",
    "test/mutation": "damages 40 files of every format",
    "test/recovery/test_faults.py": "every fault of the data at every size",
    "test/recovery/test_grades.py": "every IMU file, from samples to result",
    "test/test_wheels.py": "builds and unpacks the wheels",
    "test/sdimu_calibration/cli/test_terminal.py": "every verb in a window of another size",
    "test/sdimu_calibration/report/workbench/test_speed.py": "times the workbench",
    "test/sdimu_study": "small versions of the campaigns",
}
"""Files and folders, with the reason."""

QUICK_ROS = (
    "test/ros/test_whole_run.py",
    "test/ros/test_robustness.py::test_a_killed_calibration_is_not_waited_for_and_its_successor_goes_on",
    "test/ros/test_robustness.py::test_a_node_that_fails_is_reported_in_one_line",
    "test/ros/test_sockets.py::test_the_sockets_of_a_domain",
)
"""Tests over DDS that `make test` keeps; all others marked `ros` start nodes and wait for them in `.ci/run`."""


def is_thorough(name: str, over_dds: bool) -> bool:
    """Say whether a test is left to `.ci/run`.

    Parameters
    ----------
    name : str
        Of the test, as pytest prints it, from the root of the repository.
    over_dds : bool
        Whether it starts nodes (marker `ros`).
    """
    if over_dds:
        return not name.startswith(QUICK_ROS)
    return name.startswith(tuple(THOROUGH))
