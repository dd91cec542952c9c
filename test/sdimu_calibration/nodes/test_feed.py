"""What waits in front of the live filter, without a topic: one sample with a stamp of another year costs nothing."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from resting import START, give, messages

from sdimu_calibration.core.front_door import OpeningOptions
from sdimu_calibration.core.live import NS, LiveCalibration
from sdimu_calibration.nodes.feed import Feed
from sdimu_calibration.storage.bags.cdr import encode_imu
from sdimu_calibration.storage.files.config import load_imu, load_model, load_site
from sdimu_calibration.storage.files.journal import Journal, digest

AHEAD = 2_000_000_000 * NS
STRAY, KILLED = 1210, 2000


def with_stray(raw: list[bytes]) -> list[bytes]:
    """Put one message of another year among others."""
    return [
        *raw[:STRAY],
        *encode_imu(np.array([AHEAD]), np.full((1, 3), 4e-5), np.array([[0.0, 0.0, -9.8]])),
        *raw[STRAY:],
    ]


def feed_of(path: Path) -> Feed:
    options = OpeningOptions(load_imu("dtg"), load_site("daejeon"))
    return Feed(lambda: LiveCalibration(options, load_model("baseline")), Journal(path, digest("same")))


def test_a_stamp_years_ahead_stops_neither_the_filter_on_the_way_nor_its_end(tmp_path):
    feed, clean = feed_of(tmp_path / "stray"), feed_of(tmp_path / "clean")
    assert give(feed, with_stray(messages())) == give(clean, messages())
    assert feed.imu_ns == clean.imu_ns
    assert sum("outside the test (2033-05-18" in note for note in feed.notes()) == 1
    np.testing.assert_array_equal(feed.finish().values, clean.finish().values)


def test_a_journal_with_a_stamp_years_ahead_is_gone_on_with(tmp_path):
    raw = with_stray(messages())
    give(feed_of(tmp_path / "j"), raw[:KILLED])  # killed: nothing was closed
    successor, clean = feed_of(tmp_path / "j"), feed_of(tmp_path / "clean")
    assert successor.resumed_ns == START + (KILLED - 1) * (NS // 100)
    give(successor, raw[KILLED - 500 :])
    give(clean, messages())
    assert not any("of another test" in note for note in successor.notes())
    result, expected = successor.finish(), clean.finish()
    np.testing.assert_array_equal(result.values, expected.values)
    np.testing.assert_array_equal(result.covariance, expected.covariance)
