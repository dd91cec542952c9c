"""A handheld run says what was wrong with its data."""

from dataclasses import replace

import numpy as np
import pytest

from sdimu_calibration.core.data.gaps import step_fault, told_together
from sdimu_calibration.core.diagnosis.screen import screen
from sdimu_calibration.core.estimation.outcome import calibrate, outcome
from sdimu_calibration.core.estimation.prepared_test import PreparedTest
from sdimu_calibration.core.estimation.solve import solve
from sdimu_calibration.core.recording import ClockStep
from sdimu_calibration.storage.files.config import load_imu, load_site
from sdimu_calibration.storage.files.effect_file import extended_model
from sdimu_sim.core.by_hand import ByHand, by_hand_recording

MEMS = load_imu("mems_by_hand")
MODEL = extended_model("hand", [])


@pytest.fixture(scope="module")
def run():
    return by_hand_recording(ByHand(12, MEMS, load_site("daejeon"), seed=3))[0]


@pytest.fixture(scope="module")
def sound(run):
    return calibrate(run, None, MEMS, MODEL, estimator="handheld")


def moved(found, sound):
    sigma = np.sqrt(np.diag(found.covariance))
    free = sigma > 0.0
    return np.max(np.abs(found.values - sound.values)[free] / sigma[free])


def test_a_sound_run_has_no_fault(sound):
    assert sound.faults == ()


def clipped_at(run, share):
    limit = share * np.abs(run.omega_ib_b).max()
    return replace(run, omega_ib_b=np.clip(run.omega_ib_b, -limit, limit))


@pytest.mark.parametrize("share", [0.8, 0.9])
def test_turns_with_clipped_gyros_say_nothing_and_the_rest_is_as_it_was(run, sound, share):
    """Their angle is too small: a scale factor went with it."""
    found = calibrate(clipped_at(run, share), None, MEMS, MODEL, estimator="handheld")
    told = [fault for fault in found.faults if fault.kind == "saturated"]
    assert told
    assert all("the turns there say nothing" in fault.text for fault in told)
    assert moved(found, sound) < 2.0
    assert found.not_to_be_trusted == ()


def test_a_reading_at_the_end_of_its_range_at_rest_is_grave_whoever_asks(run):
    """Calibrate ended with 0 where diagnose of the same bag ended with 3: one rule judges a fault."""
    fit = solve(PreparedTest(run, MEMS, None), MODEL, "handheld")
    rest = fit.test.run.rests
    middle = int((rest.first[3] + rest.last[3]) // 2)
    force = run.f_ib_b.copy()
    force[middle : middle + 4, 1] = force[:, 1].max() + 1.0
    spoilt = solve(PreparedTest(replace(run, f_ib_b=force), MEMS, None), MODEL, "handheld")
    (fault,) = [fault for fault in spoilt.faults if fault.kind == "saturated"]
    assert fault.grave
    assert "--exclude-times" in fault.text
    assert [finding.grave for finding in screen(spoilt) if finding.kind == "saturated"] == [True]
    assert fault.text in outcome(spoilt).not_to_be_trusted
    begin, end = fault.start_s - 0.1, fault.end_s + 0.1
    mended = solve(
        PreparedTest(replace(run, f_ib_b=force), MEMS, None).without_times(((begin, end),)), MODEL, "handheld"
    )
    assert not any(fault.grave for fault in mended.faults)


def test_missing_samples_are_told(run):
    keep = np.arange(len(run.t)) % 500 != 250
    gone = replace(run, t=run.t[keep], omega_ib_b=run.omega_ib_b[keep], f_ib_b=run.f_ib_b[keep])
    (fault,) = calibrate(gone, None, MEMS, MODEL, estimator="handheld").faults
    assert fault.kind == "gap"
    assert fault.count == np.count_nonzero(~keep[:-1])


def test_rates_that_no_hand_makes_are_taken_away(run, sound):
    rate = run.omega_ib_b.copy()
    rate[[1000, 2000, 3000], 2] = 1e3
    found = calibrate(replace(run, omega_ib_b=rate), None, MEMS, MODEL, estimator="handheld")
    assert found.data["rejected"] == 3
    assert "spike" in {fault.kind for fault in found.faults}
    assert moved(found, sound) < 2.0


@pytest.fixture(scope="module")
def fastest(run):
    """Row of the fastest sample."""
    return int(np.argmax(np.sum(run.omega_ib_b**2, axis=1)))


def test_steps_of_the_clock_are_told_with_time_and_size(run, fastest, sound):
    back, on = ClockStep(0.5, -0.01), ClockStep(float(run.t[fastest]), 0.025)
    found = calibrate(replace(run, clock_steps=(back, on)), None, MEMS, MODEL, estimator="handheld")
    texts = [str(fault.text) for fault in found.faults if fault.kind == "clock"]
    assert texts == [
        "the clock of the stamps was set back by 10 ms at 0.5 s at rest: samples are taken as even",
        f"the clock of the stamps was set on by 25 ms at {run.t[fastest]:.1f} s while the IMU turned, or the driver "
        "paused: samples are taken as even",
    ]
    assert moved(found, sound) < 1.0


def test_many_equal_steps_of_the_clock_are_one_line():
    steps = [ClockStep(0.5 + 10.0 * k, -0.001) for k in range(42)]
    last = ClockStep(415.0, 0.025)
    told = told_together([*(step_fault(step, resting=True) for step in steps), step_fault(last, resting=True)])
    assert [fault.text.partition(": ")[0] for fault in told] == [
        "the clock of the stamps was set back by 1 ms, 42 times from 0.5 to 410.5 s, at rest",
        "the clock of the stamps was set on by 25 ms at 415.0 s at rest, or the driver paused",
    ]
    assert [fault.count for fault in told] == [42, 1]


@pytest.mark.parametrize("lost", [5, 30])
def test_a_driver_that_paused_in_a_turn_moves_nothing(run, fastest, sound, lost):
    """Its samples are taken as even, and what was turned meanwhile is missing: the turn counts by what is open."""
    keep = np.ones(len(run.t), dtype=bool)
    keep[fastest : fastest + lost] = False
    at, size = float(run.t[fastest]), lost * run.interval_s
    paused = replace(
        run,
        t=np.where(run.t < at, run.t, run.t - size)[keep],
        omega_ib_b=run.omega_ib_b[keep],
        f_ib_b=run.f_ib_b[keep],
        clock_steps=(ClockStep(at, size),),
    )
    found = calibrate(paused, None, MEMS, MODEL, estimator="handheld")
    # In the sigmas of the sound run: a turn that is taken at its word is no noise, but all sigmas would grow with it.
    sigma = np.sqrt(np.diag(sound.covariance))
    free = sigma > 0.0
    assert np.max(np.abs(found.values - sound.values)[free] / sigma[free]) < 3.0
