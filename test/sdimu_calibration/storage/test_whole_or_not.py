"""What is written is whole or not there, belongs together, and never takes the place of what it was made from."""

from __future__ import annotations

import errno
import json
import os
import resource
import signal
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from sdimu_calibration.api import fit as api_fit
from sdimu_calibration.cli import main
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.results import Calibration, no_history
from sdimu_calibration.storage.bags import cdr
from sdimu_calibration.storage.bags.bag_folder import check_apart
from sdimu_calibration.storage.bags.bag_reader import read_recording
from sdimu_calibration.storage.bags.bag_writer import BagContent, write_recording
from sdimu_calibration.storage.bags.cut_bag import cut_bag
from sdimu_calibration.storage.bags.mcap_bag import McapBag
from sdimu_calibration.storage.bags.recover import recover
from sdimu_calibration.storage.files.whole_file import put_aside, same_file, write_whole, written_together


def names(folder):
    return sorted(entry.name for entry in folder.iterdir())


def content_of(folder):
    return {file.name: file.read_bytes() for file in folder.iterdir()}


class Stopped(BaseException):
    """What Ctrl-C does; pytest itself leaves on the real one."""


def stopped(*_, **__):
    raise Stopped


def interrupt(monkeypatch):
    """Let Ctrl-C come when the last messages have been handed over."""
    whole = McapBag.write_merged

    def write(self, streams):
        whole(self, streams)
        raise Stopped

    monkeypatch.setattr(McapBag, "write_merged", write)


def test_an_interrupted_bag_is_not_there(bag, tmp_path, small_test, monkeypatch):
    # Cut and import write their bags the same way.
    interrupt(monkeypatch)
    with pytest.raises(Stopped):
        cut_bag(bag, tmp_path / "part", 0.0, 2.0)
    with pytest.raises(Stopped):
        small_test.write(tmp_path / "imported")
    assert names(tmp_path) == ["small"]


def test_what_was_there_stays_until_the_new_bag_is_whole(bag, tmp_path, small_test, monkeypatch):
    old = small_test.write(tmp_path / "old")
    before = content_of(old)
    with monkeypatch.context() as m:
        m.setattr(McapBag, "write_merged", stopped)
        with pytest.raises(Stopped):
            cut_bag(bag, old, 0.0, 2.0, replace=True)
    assert content_of(old) == before
    cut_bag(bag, old, 0.0, 2.0, replace=True)
    assert len(read_recording(old).t) == 201
    assert names(tmp_path) == ["old", "small"]


def test_a_bag_that_is_interrupted_while_it_is_closed_is_not_there(tmp_path, monkeypatch):
    monkeypatch.setattr("sdimu_calibration.storage.bags.mcap_bag.put_in_place", stopped)
    with pytest.raises(Stopped), McapBag(tmp_path / "b") as bag:
        bag.topic("/imu/data_raw", cdr.IMU)
    assert names(tmp_path) == []


def test_the_first_of_two_writers_of_one_bag_wins_and_the_second_is_told(tmp_path, small_test):
    with pytest.raises(DataError, match="already there"), McapBag(tmp_path / "b"):
        small_test.write(tmp_path / "b")
    assert len(read_recording(tmp_path / "b").t) == len(small_test.ns)
    assert names(tmp_path) == ["b"]


@pytest.mark.parametrize("source", ["folder", "file"])
def test_a_bag_is_never_cut_onto_itself(bag, source):
    before = content_of(bag)
    with pytest.raises(DataError, match="choose another folder"):
        cut_bag(bag if source == "folder" else next(bag.glob("*.mcap")), bag, 0.0, 2.0, replace=True)
    assert content_of(bag) == before


def test_a_link_to_a_bag_is_that_bag(bag, tmp_path):
    (tmp_path / "link").symlink_to(bag)
    with pytest.raises(DataError, match="choose another folder"):
        cut_bag(bag, tmp_path / "link", 0.0, 2.0, replace=True)
    assert (tmp_path / "link").is_symlink()


def test_a_bag_with_something_else_beside_it_is_not_replaced(bag, small_test):
    (bag / "notes.txt").write_text("the only copy")
    with pytest.raises(DataError, match=r"notes\.txt"):
        write_recording(
            bag,
            BagContent(start_ns=0, imu_ns=small_test.ns, omega_ib_b=small_test.omega_ib_b, f_ib_b=small_test.f_ib_b),
            replace=True,
        )
    assert (bag / "notes.txt").read_text() == "the only copy"
    assert len(read_recording(bag).t) == len(small_test.ns)


def test_a_full_disk_is_one_line_that_names_the_bag(tmp_path):
    made = McapBag(tmp_path / "b", live=True)
    made.topic("/imu/data_raw", cdr.IMU)
    raw = cdr.encode_imu(np.array([1]), np.zeros((1, 3)), np.zeros((1, 3)))[0]
    for k in range(3):
        made.write("/imu/data_raw", raw, 1 + k)
    made.flush()
    made.write("/imu/data_raw", raw, 9)
    with open("/dev/full", "wb", buffering=0) as full:  # noqa: PTH123 (a device, not a path of ours)
        made._writer._stream = full
        with pytest.raises(DataError, match=r"/b: the bag cannot be written \(No space left on device\).*bag recover"):
            made.flush()
    # Room that comes back now would leave a hole in the middle of the file.
    made.close()
    made.close()
    (salvage,) = recover(tmp_path / "b")
    assert salvage.counts["/imu/data_raw"] == 3


def result():
    return Calibration(
        "prior",
        ("gyro_bias",),
        ("gyro_bias_x",),
        ("rad/s",),
        ("deg/h",),
        np.zeros(1),
        np.eye(1),
        {},
        {},
        (),
        no_history(1),
    )


def test_a_result_without_its_report_is_not_left(tmp_path, monkeypatch):
    write_whole(tmp_path / "result.json", "old")
    write_whole(tmp_path / "report.html", "old")
    monkeypatch.setattr(api_fit, "write_report", stopped)
    with pytest.raises(Stopped):
        api_fit.CalibrationFit.save(SimpleNamespace(result=result(), core=None), tmp_path)
    assert content_of(tmp_path) == {"result.json": b"old", "report.html": b"old"}


def test_two_runs_into_one_folder_leave_the_files_of_one(tmp_path):
    with written_together(tmp_path) as slow:
        write_whole(slow / "result.json", "slow")
        with written_together(tmp_path) as quick:
            write_whole(quick / "result.json", "quick")
            write_whole(quick / "report.html", "quick")
        assert content_of_files(tmp_path) == {"result.json": "quick", "report.html": "quick"}
        write_whole(slow / "report.html", "slow")
    assert content_of_files(tmp_path) == {"result.json": "slow", "report.html": "slow"}
    assert names(tmp_path) == ["report.html", "result.json"]


def content_of_files(folder):
    return {file.name: file.read_text() for file in folder.iterdir() if file.is_file()}


def test_what_speaks_of_an_old_result_goes_with_it_and_nothing_else(tmp_path):
    for name in ("result.json", "report.html", "diagnosis.json", "thesis.tex"):
        write_whole(tmp_path / name, "old")
    with written_together(tmp_path) as part:
        write_whole(part / "result.json", "new")
    assert content_of_files(tmp_path) == {"result.json": "new", "thesis.tex": "old"}
    with written_together(tmp_path) as part:
        write_whole(part / "report.html", "of another kind")
    assert names(tmp_path) == ["report.html", "result.json", "thesis.tex"]


def test_a_file_that_cannot_be_written_leaves_the_old_one(tmp_path, monkeypatch):
    write_whole(tmp_path / "x.json", "old")
    monkeypatch.setattr("pathlib.Path.replace", stopped)
    with pytest.raises(Stopped):
        write_whole(tmp_path / "x.json", "new")
    monkeypatch.undo()
    assert content_of_files(tmp_path) == {"x.json": "old"}
    assert names(tmp_path) == ["x.json"]


def test_links_of_any_kind_lead_to_the_same_file(tmp_path):
    one, other = tmp_path / "one", tmp_path / "other"
    one.write_text("")
    other.write_text("")
    (tmp_path / "soft").symlink_to(one)
    (tmp_path / "hard").hardlink_to(one)
    for link in ("soft", "hard", "one"):
        assert same_file(tmp_path / link, one)
        with pytest.raises(DataError, match="is where"):
            check_apart(one, tmp_path / link)
    assert not same_file(other, one)
    assert not same_file(tmp_path / "none", one)


def test_a_text_with_the_bytes_of_a_path_is_written_and_json_gives_them_back(tmp_path):
    name = os.fsdecode(b"r\xff\xe9cording")
    write_whole(tmp_path / "x.json", json.dumps({"recording": name}, ensure_ascii=False))
    assert json.loads((tmp_path / "x.json").read_text(encoding="utf-8")) == {"recording": name}


def test_a_request_to_end_leaves_no_half_of_a_file(tmp_path, monkeypatch):
    def verb():
        with written_together(tmp_path) as part:
            (part / "result.json").write_text("half")
            os.kill(os.getpid(), signal.SIGTERM)
            pytest.fail("goes on")

    monkeypatch.setattr(main, "app", verb)
    with pytest.raises(SystemExit) as ending:
        main.main()
    assert ending.value.code == 128 + signal.SIGTERM
    assert names(tmp_path) == []
    assert signal.getsignal(signal.SIGTERM) is signal.SIG_DFL


def test_a_full_disk_is_told_with_the_file_that_was_to_be_written(tmp_path, monkeypatch, capsys):
    def full(*_, **__):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    def verb():
        with written_together(tmp_path) as part:
            write_whole(part / "result.json", "{}")

    monkeypatch.setattr(Path, "write_text", full)
    monkeypatch.setattr(main, "app", verb)
    with pytest.raises(SystemExit) as ending:
        main.main()
    assert ending.value.code == 1
    assert capsys.readouterr().err == f"sdimu: {tmp_path / 'result.json'}: No space left on device\n"
    assert names(tmp_path) == []


LONGEST = 4096
"""Bytes that a file may have in the test of a full disk."""


@pytest.fixture
def small_disk():
    """Let the system refuse a file longer than `LONGEST`, as a full disk does."""
    before, handler = resource.getrlimit(resource.RLIMIT_FSIZE), signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (LONGEST, before[1]))
    yield
    resource.setrlimit(resource.RLIMIT_FSIZE, before)
    signal.signal(signal.SIGXFSZ, handler)


def _together(folder):
    with written_together(folder) as part:
        write_whole(part / "result.json", "x" * 2 * LONGEST)


def _bag(folder):
    rng = np.random.default_rng(1)
    ns = np.arange(1, 1001) * 10_000_000
    samples = {"omega_ib_b": rng.standard_normal((1000, 3)), "f_ib_b": rng.standard_normal((1000, 3))}
    write_recording(folder, BagContent(start_ns=10**18, imu_ns=ns, **samples))


WORKS = {"file": lambda path: write_whole(path, "x" * 2 * LONGEST), "files": _together, "bag": _bag}


@pytest.mark.usefixtures("small_disk")
@pytest.mark.parametrize("work", WORKS)
def test_a_full_disk_leaves_no_folder_that_was_made_for_nothing(tmp_path, work):
    (tmp_path / "there").mkdir()
    for place in (tmp_path / "new" / "deeper" / "x", tmp_path / "there" / "new" / "x"):
        with pytest.raises((OSError, DataError)):
            WORKS[work](place)
    assert names(tmp_path) == ["there"]
    assert names(tmp_path / "there") == []


def test_a_folder_that_was_made_stays_where_another_has_written_into_it(tmp_path):
    def work():
        with written_together(tmp_path / "new") as part:
            (part.parent / "of another").touch()
            raise Stopped

    with pytest.raises(Stopped):
        work()
    assert names(tmp_path / "new") == ["of another"]


def test_a_file_is_put_aside_where_nothing_else_is(tmp_path):
    assert put_aside(tmp_path / "choices.json") is None
    for number in (1, 2):
        (tmp_path / "choices.json").write_text(f"test {number}")
        assert put_aside(tmp_path / "choices.json") == tmp_path / f"choices.json.{number}"
    assert [(tmp_path / name).read_text() for name in names(tmp_path)] == ["test 1", "test 2"]
