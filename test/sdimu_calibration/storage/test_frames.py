"""One topic is one IMU: messages of another `frame_id` are left out and told by name, offline and live."""

from __future__ import annotations

import numpy as np
import pytest

from sdimu_calibration.core.front_door import OpeningOptions
from sdimu_calibration.core.live import LiveCalibration
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.nodes.feed import Feed
from sdimu_calibration.storage.bags import cdr
from sdimu_calibration.storage.bags.bag_reader import read_recording
from sdimu_calibration.storage.bags.mcap_bag import McapBag
from sdimu_calibration.storage.files.config import load_imu, load_model, load_site

START_NS = 1_700_000_000_000_000_000
N = 600
NS = START_NS + 10_000_000 * np.arange(1, N + 1)


def messages(frame, ns, seed):
    rng = np.random.default_rng(seed)
    values = rng.normal(size=(len(ns), 6))
    return list(zip(ns.tolist(), cdr.encode_imu(ns, values[:, :3], values[:, 3:], frame), strict=True)), values


def mixed(*streams):
    return [raw for _, raw in sorted((m for stream in streams for m in stream), key=lambda m: m[0])]


def in_bag(path, raw):
    with McapBag(path) as bag:
        bag.topic("/imu/data_raw", cdr.IMU)
        for k, message in enumerate(raw):
            bag.write("/imu/data_raw", message, START_NS + k)
    return path


@pytest.mark.parametrize("other", ["imu_b", "imu_link_of_the_second_one", ""])
def test_of_two_publishers_the_one_with_most_samples_is_taken(tmp_path, other):
    ours, values = messages("imu_a", NS, 1)
    theirs, _ = messages(other, NS[100:500] + 3_000_000, 2)
    recording = read_recording(in_bag(tmp_path / "bag", mixed(ours, theirs)))
    np.testing.assert_array_equal(recording.omega_ib_b, values[:, :3])
    np.testing.assert_array_equal(recording.f_ib_b, values[:, 3:])
    (note,) = recording.notes
    assert f"/imu/data_raw: 400 messages are of another frame_id and left out (400 of '{other}'; 600 of 'imu_a'" in note


def test_stray_messages_are_left_out_by_name(tmp_path):
    ours, values = messages("imu_a", NS, 1)
    strays = [messages(f"stray {k}\x1b[31m", NS[50 * k : 50 * k + 1] - 40_000_000, k)[0] for k in range(1, 6)]
    recording = read_recording(in_bag(tmp_path / "bag", mixed(ours, *strays)))
    np.testing.assert_array_equal(recording.omega_ib_b, values[:, :3])
    (note,) = recording.notes
    assert "5 messages are of another frame_id" in note
    assert "and 2 more" in note
    assert note.isprintable()


def test_one_frame_is_no_news(tmp_path):
    ours, _ = messages("imu_a", NS, 1)
    assert read_recording(in_bag(tmp_path / "bag", mixed(ours))).notes == ()


def test_two_publishers_of_one_name_are_refused_as_such(tmp_path):
    ours, _ = messages("imu_a", NS, 1)
    theirs, _ = messages("imu_a", NS - 60_000_000, 2)
    late = [raw for _, raw in sorted(ours + theirs, key=lambda m: m[0] + 60_000_000 * (m in theirs))]
    with pytest.raises(DataError, match="two publishers write to one topic"):
        read_recording(in_bag(tmp_path / "bag", blocks_of(late)))


def blocks_of(raw):
    """Messages as two publishers send them that empty their buffers in turn."""
    return [
        raw[k] for at in range(0, len(raw), 8) for half in (0, 1) for k in range(at + half, min(at + 8, len(raw)), 2)
    ]


def test_live_the_stream_that_came_first_goes_on_and_the_other_is_told_once():
    options = OpeningOptions(load_imu("dtg"), load_site("daejeon"))
    feed = Feed(lambda: LiveCalibration(options, load_model("baseline")))
    ours, values = messages("imu_a", NS, 1)
    theirs, _ = messages("imu_b", NS[100:] + 3_000_000, 2)
    for k, message in enumerate(mixed(ours, theirs)):
        feed.take_imu(message)
        if k % 20 == 19:
            feed.decode()
    feed.decode()
    notes = [note for note in feed.notes() if "frame_id" in note]
    assert len(notes) == 1
    assert "'imu_b'" in notes[0]
    raw = feed._live._raw()
    np.testing.assert_array_equal(raw.ns, NS)
    np.testing.assert_array_equal(raw.omega_ib_b, values[:, :3])


def test_a_driver_that_is_started_again_under_another_name_is_the_same_imu(tmp_path):
    ours, values = messages("imu_a", NS, 1)
    renamed, _ = messages("imu_b", NS, 1)
    recording = read_recording(in_bag(tmp_path / "bag", mixed(ours[:450], renamed[450:])))
    np.testing.assert_array_equal(recording.f_ib_b, values[:, 3:])
    assert recording.notes == ()
