"""A driver of deg/s and g with jittering stamps: the live node's answer is that of the bag which it leaves."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sdimu_calibration.core.plan import Plan
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.storage.bags.bag_file import raw_messages
from sdimu_calibration.storage.bags.bag_writer import BagContent, write_recording
from sdimu_calibration.storage.bags.cdr import JOINT_STATE
from sdimu_calibration.storage.files.config import load_imu, load_plan, load_site
from sdimu_calibration.storage.files.result_file import read_result
from sdimu_sim.core.scenario import Scenario, generate

from .conftest import CALIBRATION, DEADLINE_S, RECORDER, FitSession, imu_stamps, sdimu

pytestmark = pytest.mark.ros

G = 9.80665
START = 1_700_000_000_000_000_000
REPLAY = "sdimu_calibration.nodes.replay_node"
PLAN = load_plan("kim18")
SHORT = Plan(
    "kim18 in a hurry",
    (12.0,) * len(PLAN.dwell_s),
    tuple(replace(turn, rate_rad_s=np.radians(18.0)) for turn in PLAN.turns),
    np.radians(18.0),
)


def driver(path: Path, status: bool) -> np.ndarray:
    """Leave the messages of the driver in a bag for the node that plays them; return their stamps."""
    r = generate(Scenario(SHORT, load_imu("dtg"), load_site("daejeon"), rate_hz=20.0, seed=72))[0]
    jitter = np.random.default_rng(3).uniform(-4e-3, 4e-3, len(r.t))
    ns = np.rint((r.t + jitter) * 1e9).astype(np.int64)
    second = np.arange(0.0, r.t[-1] + 1.0)
    row = np.searchsorted(r.phase.t, second, side="right") - 1
    at = (second * 1e9).astype(np.int64)
    write_recording(
        path,
        BagContent(
            start_ns=START,
            imu_ns=ns,
            omega_ib_b=np.degrees(r.omega_ib_b),
            f_ib_b=r.f_ib_b / G,
            status=(at, r.phase.dwell[row], r.phase.stop[row]) if status else None,
        ),
    )
    return START + ns


@pytest.mark.parametrize("status", [True, False])
def test_foreign_units_and_stamps_give_the_same_digits_live_and_from_the_bag(bench: FitSession, status: bool) -> None:
    stamps = driver(bench.folder / "driver", status)
    bag = bench.folder / "bag"
    bench.children.start(
        "recorder", RECORDER, {"out": str(bag), "wait_for": ["/imu/data_raw", "/calibration/coefficients"]}
    )
    bench.children.start("calibration", CALIBRATION, {"out": str(bench.folder), "site": "daejeon"})
    bench.children.start("replay", REPLAY, {"bag": str(bench.folder / "driver"), "consumers": 2})
    bench.wait_for_end()
    np.testing.assert_array_equal(imu_stamps(bag), stamps)
    live = read_result(bench.folder / "result.json")
    process = sdimu("calibrate", bag, "--site", "daejeon", "--out", bench.folder / "offline")
    _, err = process.communicate(timeout=DEADLINE_S)
    assert process.returncode == 0, err
    offline = read_result(bench.folder / "offline" / "result.json")
    np.testing.assert_array_equal(live.values, offline.values)
    np.testing.assert_array_equal(live.covariance, offline.covariance)
    assert live.fit == offline.fit
    assert live.data == offline.data
    told = " ".join(live.notes)
    for words in ("in g", "in deg/s", "samples are taken as even"):
        assert words in told
    # The filter on the way caught up after the first turn had told the unit.
    coefficients = "/calibration/coefficients"
    count = len(raw_messages(bag, {coefficients: JOINT_STATE}, coefficients)[coefficients])
    assert count > 0.95 * (stamps[-1] - stamps[0]) * 1e-9
    assert "the filter waits" in (bench.folder / "log" / "calibration.log").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("parameter", "words"),
    [
        ({"gyro_unit": "turns"}, "unknown unit"),
        ({"accel_unit": "deg"}, "expected a unit"),
        ({"gyro_sign": 2}, "expected 1 or -1"),
    ],
)
def test_a_unit_or_sign_that_is_none_is_refused_as_by_the_command_line(
    bench: FitSession, parameter: dict[str, object], words: str
) -> None:
    complaints: list[str] = []

    def failed() -> bool:
        try:
            return not bench.children.running()
        except DataError as error:
            complaints.append(str(error))
            return True

    bench.children.start("calibration", CALIBRATION, {"out": str(bench.folder)} | parameter)
    bench.wait(failed, "failure")
    assert words in complaints[0]
