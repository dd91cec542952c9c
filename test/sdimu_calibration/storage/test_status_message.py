"""One rule for reader and node: what a status says, and what says nothing."""

from __future__ import annotations

import numpy as np
import pytest

from sdimu_calibration.core.recording import UNNUMBERED, seconds
from sdimu_calibration.storage.bags import cdr
from sdimu_calibration.storage.bags.bag_reader import read_recording
from sdimu_calibration.storage.bags.mcap_bag import McapBag
from sdimu_calibration.storage.bags.status_message import first_entry, phase_entry, stamp_ns

START = 1_700_000_000 * 10**9


@pytest.mark.parametrize(
    ("text", "values", "entry"),
    [
        ("", {"phase": "dwell", "stop": "4"}, (7, True, 4)),
        ("rotating", {}, (7, False, UNNUMBERED)),
        (" Dwell ", {"stop": " 12 "}, (7, True, 12)),
        ("dwell", {"phase": "moving", "stop": "4"}, None),
        ("all is well", {}, None),
        ("", {}, None),
    ],
)
def test_only_dwell_and_rotating_are_phases(text, values, entry):
    assert phase_entry(7, text, values) == entry


@pytest.mark.parametrize("stop", ["\u00b2", "\u0663", "9" * 30, "9" * 5000, "-1", "1.0", "0x3", "1_000", ""])
def test_a_stop_that_is_no_short_number_is_unnumbered(stop):
    assert phase_entry(7, "", {"phase": "dwell", "stop": stop}) == (7, True, UNNUMBERED)


def test_the_largest_stop_fits_every_integer():
    assert phase_entry(7, "", {"phase": "dwell", "stop": "9" * 9}) == (7, True, 10**9 - 1)


def said(word: str, ns: int, stop: str = "0") -> bytes:
    """A status as it travels."""
    layout = cdr.Layout("rate_table").count(1).byte(0).string("rate_table").string(word).string("rate_table")
    layout.count(2).string("phase").string(word).string("stop").string(stop)
    return cdr.as_bytes(layout.rows(np.array([ns])))[0]


WORDS = ("dwell", "homing", "rotating", "fault", "dwell")
STOPS = ("0", "1", "9" * 30, "\u0663", "2")


def test_bag_and_node_take_the_same_words_and_numbers(tmp_path):
    from diagnostic_msgs.msg import DiagnosticArray
    from rclpy.serialization import deserialize_message

    ns = START + np.arange(len(WORDS), dtype=np.int64) * 10**9
    raw = [said(*entry) for entry in zip(WORDS, ns.tolist(), STOPS, strict=True)]
    samples = START + (1 + np.arange(500)) * 10**7
    with McapBag(tmp_path / "bag") as bag:
        bag.topic("/imu/data_raw", cdr.IMU)
        bag.topic("/rate_table/status", cdr.STATUS)
        imu = cdr.encode_imu(samples, np.zeros((500, 3)), np.tile([0.0, 0.0, -9.8], (500, 1)))
        bag.write_merged({"/imu/data_raw": (samples, imu), "/rate_table/status": (ns, raw)})
    found = read_recording(tmp_path / "bag")
    messages = [deserialize_message(data, DiagnosticArray) for data in raw]
    node = [entry for m in messages if (entry := phase_entry(stamp_ns(m), *first_entry(m))) is not None]
    assert [(at, dwell) for at, dwell, _ in node] == [(ns[0], True), (ns[2], False), (ns[4], True)]
    assert [stop for _, _, stop in node] == [0, UNNUMBERED, 2]
    np.testing.assert_array_equal(found.phase.t, seconds(np.array([at for at, _, _ in node]), found.start_ns))
    np.testing.assert_array_equal(found.phase.dwell, [dwell for _, dwell, _ in node])
    assert "2 messages of /rate_table/status said neither dwell nor rotating: ignored" in found.notes
