"""What lets an epoch be processed."""

from __future__ import annotations

from sdimu_calibration.nodes.gate import GREETING_S, LAPSE_DATA_S, LAPSE_WALL_S, Companion


def test_nothing_goes_beyond_the_status_that_is_in() -> None:
    status = Companion()
    status.take(7.0, now=100.0)
    assert status.allows(9.0, published=True, now=100.1, born=90.0) == (7.0, True)


def test_a_late_status_does_not_take_time_back() -> None:
    status = Companion()
    status.take(7.0, now=100.0)
    status.take(3.0, now=100.0)
    assert status.allows(9.0, published=True, now=100.1, born=90.0) == (7.0, True)


def test_a_status_that_fell_silent_is_given_up_only_after_data_and_wall_time() -> None:
    status = Companion()
    status.take(7.0, now=100.0)
    beyond = 7.0 + LAPSE_DATA_S + 1.0
    assert status.allows(beyond, published=True, now=100.0 + 0.5 * LAPSE_WALL_S, born=90.0) == (7.0, True)
    assert status.allows(8.0, published=True, now=200.0, born=90.0) == (7.0, True)
    assert status.allows(beyond, published=True, now=100.0 + 2.0 * LAPSE_WALL_S, born=90.0) == (beyond, False)


def test_without_a_publisher_the_imu_decides_once_discovery_had_its_time() -> None:
    status = Companion()
    until, _ = status.allows(9.0, published=False, now=90.1, born=90.0)
    assert until < 0.0
    assert status.allows(9.0, published=False, now=90.1 + GREETING_S, born=90.0) == (9.0, False)
