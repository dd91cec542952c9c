"""Rests of a run by hand that somebody states: by times, by a phase, and without some times."""

from dataclasses import replace

import numpy as np
import pytest

from sdimu_calibration.core.data.stated_rests import without_spans
from sdimu_calibration.core.data.static_detection import SHORTEST_S, StaticIntervals, detect_static
from sdimu_calibration.core.estimation.prepared_test import PreparedTest
from sdimu_calibration.core.estimation.solve import solve
from sdimu_calibration.core.handheld.handheld import Told, prepare_run
from sdimu_calibration.core.recording import DataError, PhaseLog
from sdimu_calibration.core.specification import Site
from sdimu_calibration.storage.files.config import load_imu, load_model
from sdimu_sim.core.by_hand import ByHand, by_hand_recording

IMU, MODEL = load_imu("mems_by_hand"), load_model("hand")


@pytest.fixture(scope="module")
def recording():
    """Twelve quiet rests."""
    return by_hand_recording(ByHand(12, IMU, Site(np.radians(36.4)), seed=21))[0]


@pytest.fixture(scope="module")
def times(recording):
    """When it rests."""
    found = detect_static(recording)
    return tuple(
        (float(recording.t[a]), float(recording.t[b - 1])) for a, b in zip(found.first, found.last, strict=True)
    )


def test_stated_rests_are_taken_and_no_others(recording, times):
    run = prepare_run(recording, IMU, None, Told(rests=times[2:10]))
    assert len(run.rests) == 8
    begin, end = recording.t[run.rests.first], recording.t[run.rests.last - 1]
    assert np.all(begin >= np.array(times[2:10])[:, 0] - 1e-6)
    assert np.all(end <= np.array(times[2:10])[:, 1] + 1e-6)
    assert run.notes == ("8 rests as stated",)


def test_a_rest_that_is_stated_too_long_ends_where_the_turn_begins(recording, times):
    longer = tuple((max(a - 0.3, 0.0), b + 0.3) for a, b in times)
    run = prepare_run(recording, IMU, None, Told(rests=longer))
    begin, end = recording.t[run.rests.first], recording.t[run.rests.last - 1]
    # Up to the widest step of the scatter a window of 0.3 s reaches into the turn by half of itself.
    assert np.all(begin > np.array(times)[:, 0] - 0.2)
    assert np.all(end < np.array(times)[:, 1] + 0.2)


def test_a_phase_states_the_rests_and_a_detected_one_does_not(recording, times):
    edges = np.array(times[1:11]).ravel()
    phase = PhaseLog(edges, np.tile([True, False], 10), np.repeat(np.arange(10), 2))
    assert len(prepare_run(replace(recording, phase=phase), IMU).rests) == 10
    assert len(prepare_run(replace(recording, phase=replace(phase, stated=False)), IMU).rests) == 12


def test_excluded_times_take_a_rest_away_and_leave_its_turns(recording, times):
    test = PreparedTest(recording, IMU)
    whole, part = test.run, test.without_times((times[4],)).run
    assert len(part.rests) == len(whole.rests) - 1
    assert not np.any((part.rests.first >= whole.rests.first[4]) & (part.rests.first < whole.rests.last[4]))
    # The two turns about the missing rest are one now.
    assert part.run.path[3] > whole.run.path[3] + whole.run.path[4]
    assert len(solve(test.without_times((times[4],)), MODEL, "handheld").rests()) == len(part.rests)


def test_a_stated_turn_is_refused_with_its_time(recording, times):
    wrong = (*times[:6], (times[6][1] + 0.2, times[7][0] - 0.2))
    with pytest.raises(DataError, match=r"rests: from .* the IMU turns by .* deg/s: it is no rest"):
        prepare_run(recording, IMU, None, Told(rests=wrong))


def test_rests_beyond_the_recording_or_twice_are_refused(recording, times):
    with pytest.raises(DataError, match=r"rests 900-910: 0 samples"):
        prepare_run(recording, IMU, None, Told(rests=(*times, (900.0, 910.0))))
    with pytest.raises(DataError, match="overlap"):
        prepare_run(recording, IMU, None, Told(rests=(*times, times[3])))
    with pytest.raises(DataError, match="takes every rest away"):
        prepare_run(recording, IMU, None, Told(excluded=((0.0, 1e4),)))


def test_numbers_of_stops_are_refused_with_the_option_that_does_it(recording):
    with pytest.raises(DataError, match=r"exclude.times"):
        solve(PreparedTest(recording, IMU).without_stops((3,)), MODEL, "handheld")


def test_excluded_times_leave_rests_alone_that_they_do_not_touch(recording, times):
    """One that was found and is shorter than a piece may be stays as it was found."""
    found = detect_static(recording)
    short = round(0.5 * SHORTEST_S / recording.interval_s)
    rests = StaticIntervals(
        found.first, np.append(found.first[:1] + short, found.last[1:]), found.gyro_white_noise, found.accel_white_noise
    )
    part = without_spans(recording, rests, (times[4],))
    assert (part.first[0], part.last[0]) == (rests.first[0], rests.last[0])
    assert len(part) == len(rests) - 1


def test_excluded_times_beyond_the_recording_or_backwards_are_refused(recording):
    with pytest.raises(DataError, match=r"times left out: 900-910 s begins after the recording"):
        prepare_run(recording, IMU, None, Told(excluded=((900.0, 910.0),)))
    with pytest.raises(DataError, match=r"times left out: 45-40 s is empty or backwards"):
        prepare_run(recording, IMU, None, Told(excluded=((45.0, 40.0),)))
