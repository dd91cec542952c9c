"""A bag that was cut keeps what had reached the disk."""

from __future__ import annotations

import signal
import subprocess
import sys
import textwrap

import numpy as np
import pytest
from rosbags.rosbag2 import Reader

from sdimu_calibration.core.recording import DataError
from sdimu_calibration.storage.bags import cdr
from sdimu_calibration.storage.bags.bag_info import read_info
from sdimu_calibration.storage.bags.bag_reader import read_recording
from sdimu_calibration.storage.bags.mcap_bag import McapBag
from sdimu_calibration.storage.bags.recover import recover

KILLED = """
    import os, sys, signal
    from pathlib import Path
    import numpy as np
    from sdimu_calibration.storage.bags import cdr
    from sdimu_calibration.storage.bags.mcap_bag import McapBag

    ns = (np.arange(1000) + 1) * 10_000_000
    bag = McapBag(Path(sys.argv[1]), live=True)
    bag.topic("/imu/data_raw", cdr.IMU)
    for i, raw in enumerate(cdr.encode_imu(ns, np.zeros((1000, 3)), np.ones((1000, 3)))):
        bag.write("/imu/data_raw", raw, int(ns[i]))
        if i % 100 == 99:
            bag.flush()
        if i == 950:
            os.kill(os.getpid(), signal.SIGKILL)
"""


def test_kill_9_loses_only_what_came_after_the_last_flush(tmp_path):
    path = tmp_path / "killed"
    done = subprocess.run([sys.executable, "-c", textwrap.dedent(KILLED), str(path)], check=False)
    assert done.returncode == -signal.SIGKILL
    with pytest.raises(DataError, match="sdimu bag recover"):
        read_recording(path)
    (salvage,) = recover(path)
    assert salvage.damage
    assert salvage.counts == {"/imu/data_raw": 900}
    assert len(read_recording(path).t) == 900


def test_a_mended_bag_is_whole_for_other_readers_and_the_cut_file_is_kept(bag):
    file = next(bag.glob("*.mcap"))
    cut = file.read_bytes()[: int(file.stat().st_size * 0.9)]
    file.write_bytes(cut)
    (salvage,) = recover(bag)
    assert file.with_name(file.name + ".damaged").read_bytes() == cut
    with Reader(bag) as reader:
        assert reader.message_count == sum(salvage.counts.values()) == sum(1 for _ in reader.messages())


def test_a_bag_that_is_cut_twice_keeps_both_cut_files(bag):
    file = next(bag.glob("*.mcap"))
    cuts = []
    for _ in range(2):
        cuts.append(file.read_bytes()[: int(file.stat().st_size * 0.9)])
        file.write_bytes(cuts[-1])
        (salvage,) = recover(bag)
        assert salvage.kept is not None
        assert salvage.kept.read_bytes() == cuts[-1]
    assert {path.read_bytes() for path in bag.glob("*.damaged*")} == set(cuts)


def test_mending_keeps_the_numbers(tmp_path, small_test):
    written = type(small_test)(20_000)
    bag = written.write(tmp_path / "long")
    file = next(bag.glob("*.mcap"))
    file.write_bytes(file.read_bytes()[: int(file.stat().st_size * 0.6)])
    recover(bag)
    r = read_recording(bag)
    assert 0 < len(r.t) < 20_000
    assert np.array_equal(r.omega_ib_b, written.omega_ib_b[: len(r.t)])


def test_a_whole_bag_is_left_as_it_is(bag):
    file = next(bag.glob("*.mcap"))
    before = file.read_bytes()
    (salvage,) = recover(bag)
    assert not salvage.damage
    assert file.read_bytes() == before
    assert [path.name for path in bag.iterdir() if path.suffix in {".damaged", ".part"}] == []


def test_metadata_is_made_anew_when_it_is_lost(bag):
    (bag / "metadata.yaml").unlink()
    recover(bag)
    with Reader(bag) as reader:
        assert reader.message_count == sum(read_info(bag).counts.values())


def test_a_file_without_one_whole_message_is_told_and_kept(bag):
    file = next(bag.glob("*.mcap"))
    stub = file.read_bytes()[:200]
    file.write_bytes(stub)
    with pytest.raises(DataError, match="nothing can be saved"):
        recover(file)
    assert file.read_bytes() == stub


def test_info_of_a_cut_bag_counts_what_is_whole_and_names_the_damage(bag):
    whole = read_info(bag)
    file = next(bag.glob("*.mcap"))
    file.write_bytes(file.read_bytes()[:-100])
    cut = read_info(bag)
    assert whole.damaged == []
    assert cut.damaged == [file]
    assert cut.counts == whole.counts


def test_a_bag_that_is_being_written_is_neither_mended_nor_replaced_and_loses_nothing(tmp_path):
    path = tmp_path / "live"
    ns = (np.arange(200) + 1) * 10_000_000
    messages = cdr.encode_imu(ns, np.zeros((200, 3)), np.ones((200, 3)))
    recorder = McapBag(path, live=True)
    recorder.topic("/imu/data_raw", cdr.IMU)
    for k, message in enumerate(messages):
        recorder.write("/imu/data_raw", message, int(ns[k]))
        if k == 100:
            recorder.flush()
            with pytest.raises(DataError, match=r"live_0\.mcap: is being written"):
                recover(path)
            with pytest.raises(DataError, match=r"live_0\.mcap: is being written"):
                McapBag(path, replace=True, live=True)
    recorder.close()
    assert sorted(file.name for file in path.iterdir()) == ["live_0.mcap", "metadata.yaml"]
    assert len(read_recording(path).t) == 200
    assert not recover(path)[0].damage
