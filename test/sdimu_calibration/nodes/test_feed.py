"""What waits in front of the live filter, without a topic: one sample with a stamp of another year costs nothing."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from sdimu_calibration.core.front_door import OpeningOptions
from sdimu_calibration.core.live import NS, LiveCalibration
from sdimu_calibration.nodes.feed import Feed
from sdimu_calibration.storage.bags.cdr import encode_imu
from sdimu_calibration.storage.files.config import load_imu, load_model, load_site
from sdimu_calibration.storage.files.journal import Journal, digest

START = 1_700_000_000 * NS
AHEAD = 2_000_000_000 * NS
COUNT, BLOCK, STRAY, KILLED = 4000, 20, 1210, 2000


def messages(stray: bool) -> list[bytes]:
    """Forty seconds at rest as raw messages; the stray one is one more."""
    rng = np.random.default_rng(1)
    ns = START + (1 + np.arange(COUNT, dtype=np.int64)) * (NS // 100)
    omega = 4e-5 + 1e-6 * rng.standard_normal((COUNT, 3))
    force = [0.0, 0.0, -9.8] + 1e-3 * rng.standard_normal((COUNT, 3))
    raw = list(encode_imu(ns, omega, force))
    if stray:
        raw[STRAY:STRAY] = encode_imu(np.array([AHEAD]), omega[:1], force[:1])
    return raw


def feed_of(path: Path) -> Feed:
    options = OpeningOptions(load_imu("dtg"), load_site("daejeon"))
    return Feed(lambda: LiveCalibration(options, load_model("baseline")), Journal(path, digest("same")))


def give(feed: Feed, raw: list[bytes]) -> list[int]:
    """Hand over messages in blocks with a status every second, as the node does; stamps of the estimates."""
    told = []
    for k in range(0, len(raw), BLOCK):
        for message in raw[k : k + BLOCK]:
            feed.take_imu(message)
        reached = feed.decode()
        if reached:
            feed.take_status(reached - reached % NS, True, 0)
        told += [estimate.ns for estimate in feed.process(True, False)]
    return told


def test_a_stamp_years_ahead_stops_neither_the_filter_on_the_way_nor_its_end(tmp_path):
    feed, clean = feed_of(tmp_path / "stray"), feed_of(tmp_path / "clean")
    assert give(feed, messages(stray=True)) == give(clean, messages(stray=False))
    assert feed.imu_ns == clean.imu_ns
    assert sum("outside the test (2033-05-18" in note for note in feed.notes()) == 1
    np.testing.assert_array_equal(feed.finish().values, clean.finish().values)


def test_a_journal_with_a_stamp_years_ahead_is_gone_on_with(tmp_path):
    raw = messages(stray=True)
    give(feed_of(tmp_path / "j"), raw[:KILLED])  # killed: nothing was closed
    successor, clean = feed_of(tmp_path / "j"), feed_of(tmp_path / "clean")
    assert successor.resumed_ns == START + (KILLED - 1) * (NS // 100)
    give(successor, raw[KILLED - 500 :])
    give(clean, messages(stray=False))
    assert not any("of another test" in note for note in successor.notes())
    result, expected = successor.finish(), clean.finish()
    np.testing.assert_array_equal(result.values, expected.values)
    np.testing.assert_array_equal(result.covariance, expected.covariance)
