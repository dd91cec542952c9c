"""The noise in the result of a diagnosis is the noise that is told: with the intervals of its sizes."""

from __future__ import annotations

from sdimu_calibration.core.diagnosis.diagnose import diagnose
from sdimu_calibration.core.recording import Recording
from sdimu_calibration.storage.files.config import load_plan
from sdimu_sim.core.scenario import Scenario, generate


def recording(bench) -> Recording:
    """A right model in flicker of three times the size that the data sheet of the class has."""
    noise = ("gyro_noise_flicker=0.03 deg/h",)
    scenario = Scenario(load_plan("recommended"), bench.imu, bench.site, rate_hz=20.0, seed=5, noise=noise)
    return generate(scenario)[0]


def test_a_result_states_the_intervals_that_are_told(bench):
    found = diagnose(recording(bench), bench.site, bench.imu, bench.model)
    assert found.found.noise
    assert found.after.noise == found.found.noise
    assert all(0.0 < term.low < term.size < term.high for term in found.after.noise)
