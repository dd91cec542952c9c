"""Faults in the data: no test with one ends silently wrong, or in a traceback. The whole matrix is marked slow."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sdimu_calibration.core.data.arrival import arrange
from sdimu_calibration.core.estimation.outcome import calibrate
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.storage.files.config import load_imu, load_model, load_plan, load_site
from sdimu_sim.core.scenario import Scenario
from sdimu_study.fault_kinds import FAULTS, Fault
from sdimu_study.faults import (
    NOTED,
    OK,
    REFUSED,
    TRACEBACK,
    WARNED,
    WRONG,
    as_read,
    fault_study,
    hurried,
    run_fault,
    spoilt,
)

SCENARIO = Scenario(hurried(load_plan("kim18_signed")), load_imu("dtg"), load_site("daejeon"))
MODEL = load_model("baseline")
FAULT = {fault.name: fault for fault in FAULTS}
NONE = Fault("none", "nothing", "", (0, 0, 0, 0, 0), samples=lambda recording, _size, _rng: recording)


@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault.name)
def test_no_fault_ends_silently_wrong(fault):
    """Middle and largest size; the seed is that of the date on which this was written."""
    for size in (fault.sizes[2], fault.sizes[4]):
        outcome = run_fault(SCENARIO, MODEL, fault, size, 1121)
        assert outcome.verdict not in {WRONG, TRACEBACK}, outcome
        assert all("\n" not in line for line in outcome.said)


@pytest.mark.slow
def test_no_fault_of_any_size_ends_silently_wrong():
    outcomes = fault_study(SCENARIO, MODEL, range(2001, 2006))
    bad = [o for o in outcomes if o.verdict in {WRONG, TRACEBACK}]
    assert not bad, bad


def test_a_sound_test_has_nothing_to_say():
    for seed in range(1, 4):
        outcome = run_fault(SCENARIO, MODEL, NONE, 0.0, seed)
        assert outcome.verdict == OK, outcome


@pytest.mark.parametrize(
    ("name", "size"),
    [
        ("gap_at_rest", 0.5),
        ("gap_in_turn", 0.05),
        ("dropouts", 0.01),
        ("nan", 0.01),
        ("gyro_stuck", 0.03),
        ("gyro_spikes", 100.0),
        ("accel_spikes", 100.0),
        ("bump", 3.0),
        ("status_stops", 0.5),
    ],
)
def test_what_was_wrong_is_named_in_the_data_section(name, size):
    recording = spoilt(replace(SCENARIO, seed=5), FAULT[name], size)
    result = calibrate(recording, SCENARIO.site, SCENARIO.imu, MODEL, held_out=False)
    assert result.faults
    assert all(found.text in result.notes for found in result.faults)


@pytest.mark.parametrize("name", ["duplicates", "out_of_order"])
def test_what_can_be_mended_wholly_changes_no_digit(name):
    fault = FAULT[name]
    scenario = replace(SCENARIO, seed=6)
    right = calibrate(spoilt(scenario, NONE, 0.0), SCENARIO.site, SCENARIO.imu, MODEL, held_out=False)
    for size in fault.sizes[2:4]:
        found = calibrate(spoilt(scenario, fault, size), SCENARIO.site, SCENARIO.imu, MODEL, held_out=False)
        np.testing.assert_array_equal(found.values, right.values)
        np.testing.assert_array_equal(found.covariance, right.covariance)
        assert found.notes


@pytest.mark.parametrize(
    ("name", "size", "words"),
    [
        ("turns_lost", 1, "missing while the IMU turned"),
        ("clock_back_turn", 1.0, "set back by 1 s"),
        ("status_says_rotating", 1.0, "says rotating all the time"),
        ("gyro_saturated", 0.9, "end of its range"),
    ],
)
def test_what_cannot_be_bridged_is_refused_with_its_reason(name, size, words):
    outcome = run_fault(SCENARIO, MODEL, FAULT[name], size, 7)
    assert outcome.verdict == REFUSED
    assert words in outcome.said[0]


def test_other_biases_after_a_gap_are_never_silent():
    fault = FAULT["power_cycle"]
    for seed in range(11, 14):
        for size in fault.sizes:
            outcome = run_fault(SCENARIO, MODEL, fault, size, seed)
            assert outcome.verdict in {NOTED, WARNED, REFUSED}


def test_missing_samples_leave_the_sigmas_honest():
    """Chi-square of the largest errors: with one sample in ten missing, as without."""
    fault = FAULT["dropouts"]
    worst = [run_fault(SCENARIO, MODEL, fault, 0.1, seed).worst for seed in range(21, 31)]
    # The largest of 27 normals exceeds 4 once in 600; three of ten runs beyond it would be no chance.
    assert sum(w > 4.0 for w in worst) < 3


def test_samples_that_come_in_another_order_are_not_a_clock_set_back():
    """Bursts of a network: blocks that overtake each other fill the holes they left."""
    n = 400
    ns = (1 + np.arange(n, dtype=np.int64)) * 10_000_000
    values = np.random.default_rng(1).standard_normal((n, 3))
    order = np.concatenate([np.arange(100), np.arange(150, 200), np.arange(100, 150), np.arange(200, n)])
    done = arrange(ns[order], values[order], values[order], "here")
    np.testing.assert_array_equal(order[done.rows], np.arange(n))
    assert done.counts["out_of_order"] == 1


def test_a_block_sent_twice_is_not_a_clock_set_back():
    n = 400
    ns = (1 + np.arange(n, dtype=np.int64)) * 10_000_000
    values = np.random.default_rng(1).standard_normal((n, 3))
    order = np.concatenate([np.arange(150), np.arange(100, n)])
    done = arrange(ns[order], values[order], values[order], "here")
    np.testing.assert_array_equal(order[done.rows], np.arange(n))


def test_a_clock_set_back_is_refused_wherever_it_falls_on_the_raster():
    recording = spoilt(replace(SCENARIO, seed=8), NONE, 0.0)
    for back in (0.05, 0.113, 2.0, 50.0):
        t = np.where(np.arange(len(recording.t)) > 20_000, recording.t - back, recording.t)
        with pytest.raises(DataError, match="set back"):
            as_read(replace(recording, t=t))


@pytest.mark.parametrize("name", ["clock_forward_turn", "clock_back_turn"])
def test_a_short_step_of_the_clock_in_a_turn_is_told_and_harms_nothing(name):
    outcome = run_fault(SCENARIO, MODEL, FAULT[name], 0.004, 1)
    assert outcome.verdict == NOTED
    assert outcome.worst < 5.0
    assert any("the clock of the stamps was set" in text and "by 4 ms" in text for text in outcome.said)


def test_stamps_that_many_readings_share_are_no_times():
    n = 400
    values = np.random.default_rng(1).standard_normal((n, 3))
    pairs = np.repeat(np.arange(1, n // 2 + 1, dtype=np.int64), 2) * 20_000_000
    with pytest.raises(DataError, match="are not the times of the samples"):
        arrange(pairs, values, values, "here")
    # Every sample sent twice is another thing: nothing about its time is wrong.
    twice = np.repeat(values[: n // 2], 2, axis=0)
    assert len(arrange(pairs, twice, twice, "here").rows) == n // 2
