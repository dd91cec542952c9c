"""A simulated test as a bag: the same topics as over DDS."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from rate_table_sim.core import phase_changes
from sdimu_calibration.core.arrays import Floats, Ints
from sdimu_calibration.storage.bags.bag_writer import BagContent, write_recording
from sdimu_sim.core.generator import ImuSamples
from sdimu_sim.core.scenario import DEFAULT_START_NS, Scenario, SimulatedTest, table_log_rows, temperature_log


def write_test(
    path: Path,
    scenario: Scenario,
    test: SimulatedTest,
    *,
    replace: bool = False,
    custom: Mapping[str, str] | None = None,
) -> None:
    """Write a simulated test to a rosbag2 folder; `custom` is what its metadata says of the unit."""
    motion = test.motion
    t, dwell, stop = phase_changes(motion)
    rows = table_log_rows(motion)
    heat = temperature_log(scenario, float(motion.t[-1]))
    write_recording(
        path,
        BagContent(
            start_ns=scenario.start_ns,
            imu_ns=test.samples.ns,
            omega_ib_b=test.samples.omega_ib_b,
            f_ib_b=test.samples.f_ib_b,
            status=(_nanoseconds(t), dwell, stop),
            joint_states=(_nanoseconds(motion.t[rows]), motion.names, motion.encoder_angle[rows], motion.rate[rows]),
            temperature=None if heat is None else (_nanoseconds(heat.t), heat.value),
        ),
        replace=replace,
        custom=custom,
    )


def write_by_hand(
    path: Path, samples: ImuSamples, *, replace: bool = False, custom: Mapping[str, str] | None = None
) -> None:
    """Write a handheld run to a rosbag2 folder: samples of the IMU and nothing else."""
    write_recording(
        path,
        BagContent(start_ns=DEFAULT_START_NS, imu_ns=samples.ns, omega_ib_b=samples.omega_ib_b, f_ib_b=samples.f_ib_b),
        replace=replace,
        custom=custom,
    )


def _nanoseconds(t: Floats) -> Ints:
    return np.rint(t * 1e9).astype(np.int64)
