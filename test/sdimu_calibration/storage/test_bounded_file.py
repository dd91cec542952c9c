"""A file that never ends, or never begins, is refused at once, wherever a user may name it."""

from __future__ import annotations

import os
import signal
import sys
from contextlib import contextmanager
from pathlib import Path

import pytest

from sdimu_calibration.cli import main as cli
from sdimu_calibration.cli.options import read_rests
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.storage.bags.bag_file import bag_parts
from sdimu_calibration.storage.bags.bag_metadata import METADATA
from sdimu_calibration.storage.bags.bag_reader import read_recording
from sdimu_calibration.storage.files.bounded_file import check_regular, read_bounded, read_text
from sdimu_calibration.storage.files.config import read_mapping
from sdimu_calibration.storage.files.json_file import LONGEST_JSON, read_json
from sdimu_calibration.storage.files.limits_file import read_limits
from sdimu_calibration.storage.files.noise_terms_file import read_noise_terms
from sdimu_calibration.storage.files.reference_file import read_truth
from sdimu_calibration.storage.files.result_file import read_result
from sdimu_calibration.storage.importing.map_proposal import propose_maps
from sdimu_calibration.storage.importing.text_table import TextTable
from sdimu_calibration.storage.recording_set import BagSource, load_set, set_of

READERS = {
    "yaml": read_mapping,
    "set": lambda path: load_set(path, BagSource(Path())),
    "json": lambda path: read_json(path, "x/1"),
    "result": read_result,
    "noise": read_noise_terms,
    "limits": lambda path: read_limits(path, {"gyro bias": "deg/h"}),
    "truth": lambda path: read_truth(path, "prior"),
    "columns": TextTable,
    "map": lambda path: list(propose_maps([path])),
    "bag": bag_parts,
    "bag of a set": lambda path: set_of([path], BagSource(Path())),
}


@contextmanager
def at_once():
    """Fail where the work waits."""

    def late(*_):
        raise TimeoutError("it waits")

    before = signal.signal(signal.SIGALRM, late)
    signal.alarm(5)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


@pytest.fixture
def pipe(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    return tmp_path / "pipe"


@pytest.mark.parametrize("reader", READERS)
@pytest.mark.parametrize("what", ["pipe", "device", "link"])
def test_what_is_no_file_is_refused_at_once(tmp_path, pipe, reader, what):
    (tmp_path / "link").symlink_to("/dev/zero")
    path = {"pipe": pipe, "device": Path("/dev/zero"), "link": tmp_path / "link"}[what]
    with at_once(), pytest.raises(DataError, match="is a device or a pipe"):
        READERS[reader](path)


def test_a_pipe_with_the_rests_is_refused_at_once(pipe):
    with at_once(), pytest.raises(DataError, match="--rests"):
        read_rests(str(pipe))


@pytest.mark.parametrize("line", ["export PIPE", "compare PIPE PIPE", "compensate BAG --result PIPE --out new"])
def test_a_verb_says_so_in_one_line(monkeypatch, capsys, tmp_path, pipe, bag, line):
    words = {"PIPE": str(pipe), "BAG": str(bag)}
    monkeypatch.setattr(sys, "argv", ["sdimu", *(words.get(word, word) for word in line.split())])
    monkeypatch.chdir(tmp_path)
    with at_once(), pytest.raises(SystemExit) as ending:
        cli.main()
    err = capsys.readouterr().err
    assert (ending.value.code, err.count("\n")) == (1, 1)
    assert "is a device or a pipe" in err


@pytest.mark.parametrize("bag_of_the_set", ["/dev/zero", "pipe"])
def test_a_set_of_a_device_names_the_recording(tmp_path, bag_of_the_set):
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "set.yaml").write_text(
        f"format: sdimu-set/1\nrecordings:\n  - bag: {bag_of_the_set}\n    name: third\n"
    )
    with at_once(), pytest.raises(DataError, match=r"is a device or a pipe, and no bag .recording 'third' of the set"):
        load_set(tmp_path / "set.yaml", BagSource(Path()))


@pytest.mark.parametrize("name", ["z.mcap", METADATA])
def test_a_folder_with_a_device_or_a_pipe_beside_recordings_is_answered_at_once(bag, name):
    (bag / METADATA).unlink()
    os.mkfifo(bag / name)
    with at_once():
        if name == METADATA:
            assert len(read_recording(bag).t) > 0
        else:
            with pytest.raises(DataError, match=r"z\.mcap: is a device or a pipe"):
                read_recording(bag)


def test_a_file_is_read_to_its_longest_and_no_further(tmp_path):
    path = tmp_path / "x"
    path.write_bytes(b"1234")
    assert read_bounded(path, 4) == b"1234"
    assert read_text(path, 4) == "1234"
    with pytest.raises(DataError, match="x: longer than 3 bytes"):
        read_bounded(path, 3)
    # What the system makes as it is read says nothing of its size.
    with pytest.raises(DataError, match="longer than 3 bytes"):
        read_bounded(Path("/proc/self/status"), 3)


def test_no_more_memory_is_taken_than_the_file_needs(tmp_path):
    path = tmp_path / "x"
    path.write_bytes(b"1234")
    assert read_bounded(path, 1 << 60) == b"1234"


def test_a_file_of_holes_is_refused_before_it_is_read(tmp_path):
    with (tmp_path / "holes.json").open("wb") as stream:
        stream.truncate(LONGEST_JSON + 1)
    with at_once(), pytest.raises(DataError, match="longer than"):
        read_json(tmp_path / "holes.json", "x/1")


def test_a_folder_and_nothing_are_no_file(tmp_path):
    with pytest.raises(DataError, match="is a folder"):
        check_regular(tmp_path)
    with pytest.raises(DataError, match="no such file"):
        check_regular(tmp_path / "x")
