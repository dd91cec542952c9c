"""A whole simulated test: what the recording holds, and that it depends on the seed alone."""

from dataclasses import replace

import numpy as np
import pytest

from rate_table_sim.core import TableSpecification
from sdimu_calibration.core import earth
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.specification import ImuSpecification
from sdimu_calibration.storage.files.config import load_imu, load_plan, load_site
from sdimu_sim.core import Scenario, TemperatureProfile, generate

PERFECT = ImuSpecification("perfect", 0.0, 0.0)


@pytest.fixture(scope="module")
def scenario():
    table = TableSpecification(sample_rate_hz=20.0)
    return Scenario(load_plan("kim18"), load_imu("dtg"), load_site("daejeon"), table, rate_hz=20.0, seed=5)


def test_at_every_stop_a_perfect_imu_reads_the_size_of_gravity_and_earth_rate(scenario):
    recording, _ = generate(replace(scenario, imu=PERFECT))
    phase = recording.phase
    g = earth.normal_gravity(scenario.site.latitude_rad, 0.0)
    for stop in range(19):
        inside = phase.t[(phase.stop == stop) & phase.dwell][3]
        k = np.searchsorted(recording.t, inside)
        assert np.linalg.norm(recording.f_ib_b[k]) == pytest.approx(g, rel=1e-14)
        assert np.linalg.norm(recording.omega_ib_b[k]) == pytest.approx(earth.RATE, rel=1e-10)


def test_the_same_seed_gives_the_same_test_and_another_another(scenario):
    first, truth = generate(scenario)
    again, _ = generate(scenario)
    other, _ = generate(replace(scenario, seed=6))
    np.testing.assert_array_equal(first.omega_ib_b, again.omega_ib_b)
    assert not np.array_equal(first.omega_ib_b, other.omega_ib_b)
    assert np.abs(truth.imu.mount_rad).max() <= scenario.mount_max_rad


def test_everything_that_the_topics_would_give_is_in_the_recording(scenario):
    recording, _ = generate(replace(scenario, temperature=TemperatureProfile(rise=3.0)))
    assert len(recording.t) == 2980 * 20
    assert recording.phase.t[0] == 0.0
    assert recording.phase.stop[-1] == 18
    assert recording.temperature.t[-1] == 2980.0
    assert recording.table.names == ("outer", "middle", "inner")
    assert recording.table.angle.shape == (len(recording.table.t), 3)


@pytest.mark.parametrize("rate", [5.0, 2000.0, float("nan")])
def test_a_rate_out_of_bounds_is_refused(scenario, rate):
    with pytest.raises(DataError, match="10 to 1000 Hz"):
        generate(replace(scenario, rate_hz=rate))
