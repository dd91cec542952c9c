"""A killed calibration goes on where it was, and ends with the same answer."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from resting import COUNT, START, give, messages

from sdimu_calibration.core.data.intake import Intake
from sdimu_calibration.core.estimation.outcome import calibrate
from sdimu_calibration.core.front_door import OpeningOptions
from sdimu_calibration.core.live import NS, LiveCalibration
from sdimu_calibration.nodes.feed import AWAY_S, Feed
from sdimu_calibration.storage.bags.bag_reader import read_recording
from sdimu_calibration.storage.files.config import load_imu, load_model, load_site
from sdimu_calibration.storage.files.journal import Journal, digest
from sdimu_calibration.storage.files.result_file import read_result

from .conftest import FitSession, imu_stamps, samples_of, write_plan

SITE, IMU, MODEL = load_site("daejeon"), load_imu("dtg"), load_model("baseline")


def feed_of(path: Path) -> Feed:
    return Feed(lambda: LiveCalibration(OpeningOptions(IMU, SITE), MODEL), Journal(path, digest("same")))


@pytest.fixture(scope="module")
def unbroken(tmp_path_factory):
    feed = feed_of(tmp_path_factory.mktemp("whole") / "j")
    give(feed, messages())
    return feed.finish()


@pytest.mark.parametrize("killed_at", [60, 1000, 3980])
@pytest.mark.parametrize("again", [0, 40, 1000])
def test_a_successor_ends_with_the_same_digits_however_much_comes_again(tmp_path, unbroken, killed_at, again):
    raw = messages()
    give(feed_of(tmp_path / "j"), raw[:killed_at])  # killed: nothing was closed
    successor = feed_of(tmp_path / "j")
    list(successor.process(True, False))
    give(successor, raw[max(killed_at - again, 0) :])
    result = successor.finish()
    np.testing.assert_array_equal(result.values, unbroken.values)
    np.testing.assert_array_equal(result.covariance, unbroken.covariance)
    assert result.data == unbroken.data
    assert result.fit == unbroken.fit


def test_what_was_missed_is_a_gap_that_is_counted(tmp_path):
    raw = messages()
    give(feed_of(tmp_path / "j"), raw[:1500])
    successor = feed_of(tmp_path / "j")
    give(successor, raw[1800:])
    result = successor.finish()
    assert result.data["lost"] == 300
    assert result.data["samples"] == COUNT - 300
    assert any(fault.kind == "long gap" for fault in result.faults)


@pytest.mark.parametrize("later_s", [0.0, AWAY_S + 60.0])
def test_another_test_in_the_same_folder_begins_anew(tmp_path, later_s):
    give(feed_of(tmp_path / "j"), messages()[:1500])
    other = messages(seed=2, start=START + round(later_s * NS))
    successor = feed_of(tmp_path / "j")
    give(successor, other)
    alone = feed_of(tmp_path / "k")
    give(alone, other)
    np.testing.assert_array_equal(successor.finish().values, alone.finish().values)
    assert successor.finish().data == alone.finish().data
    # The test before did not end: its samples are nowhere else.
    assert any("of another test, which did not end" in note for note in successor.notes())
    assert Journal(tmp_path / "j.1", digest("same")).before.samples == 1500


def test_statuses_of_hours_before_another_test_do_not_pile_up(tmp_path, monkeypatch):
    monkeypatch.setattr("sdimu_calibration.nodes.feed._SINCE", 50)
    give(feed_of(tmp_path / "j"), messages()[:1500])
    other = messages(seed=2, start=START + 20_000 * NS)
    successor, alone = feed_of(tmp_path / "j"), feed_of(tmp_path / "k")
    for k in range(1000):
        successor.take_status(START + (18_000 + k) * NS, True, 0)
    assert len(successor._since) == 50
    for feed in (successor, alone):
        give(feed, other)
    np.testing.assert_array_equal(successor.finish().values, alone.finish().values)


def test_a_resumed_test_may_go_on_for_longer_than_another_test_would_be_away(tmp_path, unbroken, monkeypatch):
    monkeypatch.setattr("sdimu_calibration.nodes.feed.AWAY_S", 5.0)
    raw = messages()
    give(feed_of(tmp_path / "j"), raw[:1500])
    successor = feed_of(tmp_path / "j")
    give(successor, raw[1500:])
    np.testing.assert_array_equal(successor.finish().values, unbroken.values)
    assert successor.finish().data == unbroken.data


def test_a_successor_takes_a_long_journal_second_by_second(tmp_path, monkeypatch):
    """Not all at once: what waits for the filter does not grow with the journal."""
    give(feed_of(tmp_path / "j"), messages())
    waiting = []
    due = Intake.due

    def watched(self, until_ns):
        waiting.append(sum(len(ns) for ns, _, _ in self._queue))
        return due(self, until_ns)

    monkeypatch.setattr(Intake, "due", watched)
    feed_of(tmp_path / "j")
    assert len(waiting) >= COUNT // 100 - 2
    assert max(waiting) < 300


@pytest.mark.parametrize("again", [0, 60])
def test_what_is_known_again_is_bounded_and_enough(tmp_path, unbroken, monkeypatch, again):
    monkeypatch.setattr("sdimu_calibration.nodes.remembered._REMEMBERED", 200)
    raw = messages()
    give(feed_of(tmp_path / "j"), raw[:3000])
    successor = feed_of(tmp_path / "j")
    assert len(successor._before._known.ns) <= 2 * 220
    give(successor, raw[3000 - again :] if again else raw[1000:])
    np.testing.assert_array_equal(successor.finish().values, unbroken.values)
    assert successor.finish().data == unbroken.data


def test_another_test_after_a_long_one_is_known_by_its_beginning(tmp_path, monkeypatch):
    monkeypatch.setattr("sdimu_calibration.nodes.remembered._REMEMBERED", 200)
    give(feed_of(tmp_path / "j"), messages())
    other = messages(seed=2)
    successor, alone = feed_of(tmp_path / "j"), feed_of(tmp_path / "k")
    for feed in (successor, alone):
        give(feed, other)
    np.testing.assert_array_equal(successor.finish().values, alone.finish().values)


@pytest.mark.ros
def test_a_killed_calibration_goes_on_and_ends_with_the_same_answer(bench: FitSession) -> None:
    """The simulator waits by credits, so nothing is lost: not what was on its way, nor what came meanwhile."""
    write_plan(bench.plan, 30.0)
    bench.speed = 15.0
    for name in ("recorder", "calibration", "rate_table"):
        bench.start(name)
    bench.start("sdimu", patience_s=120.0)
    journal = bench.folder / "calibration.journal"
    bench.wait(lambda: journal.is_file() and journal.stat().st_size > 75_000, "a good part of the data")
    bench.children.kill("calibration")
    bench.start("calibration")
    bench.wait_for_end()
    stamps = imu_stamps(bench.folder / "bag")
    result = read_result(bench.folder)
    assert len(stamps) == result.data["samples"] == samples_of(30.0)
    recording = read_recording(bench.folder / "bag")
    offline = calibrate(replace(recording, table=None), SITE, IMU, MODEL)
    np.testing.assert_array_equal(result.values, offline.values)
    np.testing.assert_array_equal(result.covariance, offline.covariance)
    assert result.data == offline.data
    assert not journal.exists()
