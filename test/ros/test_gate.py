"""What lets an epoch be processed."""

from __future__ import annotations

from sdimu_calibration.core.data.stray_stamps import NEVER
from sdimu_calibration.nodes.gate import GREETING_S, LAPSE_DATA_NS, LAPSE_WALL_S, Companion

NS = 10**9
FIRST = 1_700_000_000 * NS


def at(seconds: float) -> int:
    return FIRST + round(seconds * NS)


def test_nothing_goes_beyond_the_status_that_is_in() -> None:
    status = Companion()
    status.take(at(7.0), now=100.0)
    assert status.allows(FIRST, at(9.0), published=True, now=100.1, born=90.0) == (at(7.0), True)


def test_a_late_status_does_not_take_time_back() -> None:
    status = Companion()
    status.take(at(7.0), now=100.0)
    status.take(at(3.0), now=100.0)
    assert status.allows(FIRST, at(9.0), published=True, now=100.1, born=90.0) == (at(7.0), True)


def test_a_status_that_fell_silent_is_given_up_only_after_data_and_wall_time() -> None:
    status = Companion()
    status.take(at(7.0), now=100.0)
    beyond = at(8.0) + LAPSE_DATA_NS
    assert status.allows(FIRST, beyond, published=True, now=100.0 + 0.5 * LAPSE_WALL_S, born=90.0) == (at(7.0), True)
    assert status.allows(FIRST, at(8.0), published=True, now=200.0, born=90.0) == (at(7.0), True)
    late = 100.0 + 2.0 * LAPSE_WALL_S
    assert status.allows(FIRST, beyond, published=True, now=late, born=90.0) == (beyond, False)


def test_without_a_publisher_the_imu_decides_once_discovery_had_its_time() -> None:
    status = Companion()
    until, _ = status.allows(FIRST, at(9.0), published=False, now=90.1, born=90.0)
    assert until == NEVER
    now = 90.1 + GREETING_S
    assert status.allows(FIRST, at(9.0), published=False, now=now, born=90.0) == (at(9.0), False)


def test_a_status_of_another_time_neither_opens_nor_shuts_the_gate() -> None:
    status = Companion()
    year = 365 * 86_400 * NS
    status.take(FIRST + year, now=99.0)  # before the first sample nobody knows better
    for second in (7.0, 8.0):
        status.take(at(second), 100.0, at(second))
        for stray in (0, FIRST - year, FIRST + year):
            status.take(stray, 100.0, at(second))
    assert status.allows(FIRST, at(9.0), published=True, now=100.1, born=90.0) == (at(8.0), True)


def test_a_status_whose_clock_is_far_behind_is_not_waited_for() -> None:
    status = Companion()
    status.take(at(7.0), now=100.0)
    assert status.allows(FIRST, at(67.1), published=True, now=100.0, born=90.0) == (at(67.1), False)
