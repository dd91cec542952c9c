"""A part of a bag reads as the same part of its recording."""

from __future__ import annotations

import numpy as np
import pytest

from sdimu_calibration.core.recording import DataError
from sdimu_calibration.storage.bags import cdr
from sdimu_calibration.storage.bags.bag_file import read_topics
from sdimu_calibration.storage.bags.bag_reader import read_recording
from sdimu_calibration.storage.bags.bag_writer import BagContent, write_recording
from sdimu_calibration.storage.bags.cut_bag import cut_bag
from sdimu_calibration.storage.bags.mcap_bag import McapBag

START = 1_700_000_000_000_000_000
N = 1000


@pytest.fixture
def bag(tmp_path):
    rng = np.random.default_rng(1)
    ns = 10_000_000 * np.arange(1, N + 1)
    status = (np.array([0, 3_000_000_000, 6_000_000_000]), np.array([True, False, True]), np.array([0, 0, 1]))
    write_recording(
        tmp_path / "bag",
        BagContent(
            start_ns=START,
            imu_ns=ns,
            omega_ib_b=rng.normal(size=(N, 3)),
            f_ib_b=rng.normal(size=(N, 3)),
            status=status,
            temperature=(np.array([0, 5_000_000_000]), np.array([20.0, 21.0])),
        ),
    )
    return tmp_path / "bag"


def test_the_samples_between_two_times_are_kept_as_they_were(bag, tmp_path):
    part = cut_bag(bag, tmp_path / "part", 4.0, 8.0)
    whole, cut = read_recording(bag), read_recording(tmp_path / "part")
    # Seconds count from the first sample, which is at 0.01 s; both ends are kept.
    rows = slice(400, 801)
    np.testing.assert_array_equal(cut.omega_ib_b, whole.omega_ib_b[rows])
    np.testing.assert_array_equal(cut.f_ib_b, whole.f_ib_b[rows])
    assert part.counts["/imu/data_raw"] == len(cut.t) == 401
    assert part.whole_s == pytest.approx(9.99)


def test_the_phase_at_the_cut_is_the_one_that_was_said_last(bag, tmp_path):
    cut_bag(bag, tmp_path / "part", 4.0, np.inf)
    phase = read_recording(tmp_path / "part").phase
    assert phase.dwell.tolist() == [False, True]
    assert phase.t[1] - phase.t[0] == pytest.approx(6.0 - 4.01)


def test_times_that_hold_nothing_are_refused_with_the_length(bag, tmp_path):
    with pytest.raises(DataError, match=r"10\.0 s long"):
        cut_bag(bag, tmp_path / "part", 50.0, 60.0)
    with pytest.raises(DataError, match="nothing lies between"):
        cut_bag(bag, tmp_path / "part", 8.0, 4.0)
    assert not (tmp_path / "part").exists()


def test_topics_that_the_calibration_does_not_read_are_left_out(tmp_path):
    with McapBag(tmp_path / "bag") as bag:
        bag.topic("/cmd_vel", "geometry_msgs/msg/Twist")
        bag.topic("/imu/data_raw", cdr.IMU)
        ns = (np.arange(N) + 1) * 10_000_000
        bag.write_merged({"/imu/data_raw": (ns, cdr.encode_imu(ns, np.zeros((N, 3)), np.ones((N, 3))))})
        bag.write("/cmd_vel", bytes(52), 5)
    assert cut_bag(tmp_path / "bag", tmp_path / "part", 1.0, 2.0).counts == {"/imu/data_raw": 101}


@pytest.mark.parametrize("row", [0, 500, N - 1], ids=["first", "middle", "last"])
@pytest.mark.parametrize("days", [-400, 3])
def test_samples_stamped_days_away_are_no_part_and_are_told(bag, tmp_path, row, days):
    """A sample stamped days ahead was the end of the recording, and its part held everything."""
    ns, messages = cdr.by_stamp(list(read_topics(bag, lambda *_: True)["/imu/data_raw"].raw), "/imu/data_raw")
    messages[row] = cdr.stamped(messages[row], int(ns[row]) + days * 86_400_000_000_000)
    with McapBag(tmp_path / "odd") as odd:
        odd.topic("/imu/data_raw", cdr.IMU)
        odd.topic("/imu/temperature", cdr.TEMPERATURE)
        for at, message in zip(ns.tolist(), messages, strict=True):
            odd.write("/imu/data_raw", message, at)
        away = int(ns[-1]) + 400 * 86_400_000_000_000
        for at, stamp in ((int(ns[4]), int(ns[4])), (int(ns[5]), int(ns[5])), (int(ns[9]), away)):
            odd.write("/imu/temperature", cdr.encode_temperature(np.array([stamp]), np.array([20.0]))[0], at)
    part = cut_bag(tmp_path / "odd", tmp_path / "part", 0.0, np.inf)
    assert part.counts["/imu/data_raw"] == N - 1
    assert part.counts["/imu/temperature"] == 2
    assert part.whole_s == pytest.approx(9.99, abs=0.011)
    assert part.notes[0].startswith("/imu/data_raw: 1 sample has a stamp outside the test")
    assert part.notes[1].startswith("/imu/temperature: 1 message has a stamp outside the test")
    assert read_recording(tmp_path / "part").notes == ()
