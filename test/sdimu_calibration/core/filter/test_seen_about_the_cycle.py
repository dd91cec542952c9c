"""What the passes see of the temperature's rate and of the angular acceleration: both about the cycle."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sdimu_calibration.core.alignment.prepared import reduce, set_up
from sdimu_calibration.core.diagnosis.diagnose import climb
from sdimu_calibration.core.estimation.prepared_test import PreparedTest
from sdimu_calibration.core.estimation.solve import solve
from sdimu_calibration.core.filter.passes import linearise
from sdimu_calibration.core.navigation.track import Correction, motion
from sdimu_calibration.core.planning.nominal import nominal_recording
from sdimu_calibration.core.recording import TemperatureLog
from sdimu_calibration.core.units import to_si
from sdimu_calibration.storage.files.config import load_imu, load_model, load_plan
from sdimu_sim.core.scenario import Scenario, generate
from sdimu_sim.core.temperature import TemperatureProfile

RATE = "accel_bias_temperature_rate_x"
SIZE = 811.0
"""ug*min/degC: some 40 sigma in a test with stops of 30 s."""
WARMING = TemperatureProfile(25.0, rise=8.0, tau_s=1200.0, ripple=0.3, ripple_period_s=900.0)
"""Switched on at the start: the rate is largest there, where a mean over the past minute begins at zero."""


@pytest.fixture
def perfect(three_stops, site, model):
    """Samples of a perfect IMU of a wide specification, while the temperature bends: what a pass needs."""
    recording = nominal_recording(three_stops, site)
    t = np.arange(0.0, recording.t[-1] + 1.0)
    recording = replace(recording, temperature=TemperatureLog(t, 20.0 + 0.003 * t**2))
    setup = set_up(site, load_imu("mems_industrial"), model)
    return reduce(recording, setup, screened=False), setup


def test_passes_see_the_rates_about_the_cycle(perfect):
    prepared, setup = perfect
    nothing = np.zeros(len(setup.sensors.prior))
    seen = linearise(prepared, setup, np.eye(3), nothing).seen
    expected = motion(
        prepared.cycles,
        prepared.rest,
        Correction(setup.sensors, nothing),
        np.eye(3),
        setup.around(prepared.temperature),
        predicted=True,
    )
    assert np.abs(expected.alpha).max() > np.radians(100.0)
    assert seen.alpha == pytest.approx(expected.alpha, abs=1e-6)
    assert np.array_equal(seen.temperature_rate, expected.temperature_rate)


def test_a_filter_that_runs_while_samples_arrive_sees_no_later_temperature_or_rate(perfect):
    prepared, setup = perfect
    nothing = np.zeros(len(setup.sensors.prior))
    here = len(prepared.cycles) // 2

    def seen(cycles, log):
        return motion(
            cycles,
            prepared.rest[: len(cycles)],
            Correction(setup.sensors, nothing),
            np.eye(3),
            setup.around(log),
            predicted=False,
            causal=True,
        )

    log, until = prepared.temperature, float(prepared.cycles.t[here - 1])
    so_far = TemperatureLog(log.t[log.t <= until], log.value[log.t <= until])
    whole, part = seen(prepared.cycles, log), seen(prepared.cycles[slice(0, here)], so_far)
    assert np.array_equal(whole.temperature_rate[:here], part.temperature_rate)
    assert np.array_equal(whole.alpha[:here], part.alpha)
    assert part.temperature_rate[-1] > 0.0


@pytest.fixture(scope="module")
def warming():
    """Make a test with stops of 30 s of an IMU of which squares count, with an effect of the temperature's rate."""
    imu, plan = load_imu("mems_industrial"), load_plan("kim18")
    plan = replace(plan, dwell_s=(30.0,) * len(plan.dwell_s))

    def make(site, seed: int) -> PreparedTest:
        hidden = (f"{RATE}={SIZE} ug*min/degC",)
        scenario = Scenario(plan, imu, site, rate_hz=10.0, seed=seed, temperature=WARMING, effects=hidden)
        return PreparedTest(generate(scenario)[0], imu, site)

    return make


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_the_true_model_gives_an_effect_of_the_temperature_rate_its_size(warming, site, seed):
    base = load_model("baseline")
    fit = solve(warming(site, seed), replace(base, effects=(*base.effects, RATE)), learn=False)
    value, sigma = (dict(zip(fit.names, v, strict=True))[RATE] for v in (fit.values, np.sqrt(np.diag(fit.covariance))))
    size = to_si(SIZE, "ug*min/degC")
    assert size > 20.0 * sigma
    assert abs(value - size) < 3.0 * sigma


def test_the_diagnosis_names_an_effect_of_the_temperature_rate(warming, site):
    found = climb(solve(warming(site, 1), load_model("baseline")))
    assert [c.label for c in found.chosen] == [RATE]
    assert found.verdict == "one effect"
