"""Temperature files."""

import numpy as np
import pytest

from sdimu_calibration.core.recording import DataError
from sdimu_sim.temperature_file import ROOM_DEGC, load_temperature


def test_the_profiles_that_come_along_load():
    assert load_temperature("constant").rise == 0.0
    assert load_temperature("warm-up").rise == 8.0
    ramp = load_temperature("ramp")
    # 110 degC at 2.5 degC/min, after three minutes.
    assert ramp.knots == ((0.0, -40.0), (180.0, -40.0), (180.0 + 44.0 * 60.0, pytest.approx(70.0)))
    assert ramp.reference_degc == 25.0
    cycle = load_temperature("cycle")
    t = np.array([180.0 + 600.0, cycle.knots[-1][0] - 600.0])
    assert cycle.value(t)[0] == pytest.approx(cycle.value(t)[1])
    np.testing.assert_allclose(cycle.rate(t), [0.05, -0.05])


def test_a_wrong_unit_is_named(tmp_path):
    path = tmp_path / "hot.yaml"
    path.write_text("start: 25 deg\n")
    with pytest.raises(DataError, match=r"hot.yaml: start: .*degC"):
        load_temperature(path)


def test_a_soak_is_a_number_with_its_unit_and_its_coefficients_hold_at_room_temperature():
    soak = load_temperature("-20 degC")
    assert (soak.start_degc, soak.reference_degc) == (-20.0, ROOM_DEGC)
    assert np.ptp(soak.value(np.linspace(0.0, 1e5, 7))) == 0.0


@pytest.mark.parametrize("text", ["-20", "20 s"])
def test_a_number_without_a_unit_of_temperature_is_refused(text):
    with pytest.raises(DataError, match="degC"):
        load_temperature(text)


@pytest.mark.parametrize(
    "segment", ["{hold: 3 min, ramp: 1 degC/min, to: 5 degC}", "{ramp: 1 degC/min}", "{to: 5 degC}", "{}"]
)
def test_a_segment_is_a_soak_or_a_ramp(tmp_path, segment):
    path = tmp_path / "odd.yaml"
    path.write_text(f"start: 25 degC\nsegments:\n  - {segment}\n")
    with pytest.raises(DataError, match=r"odd.yaml: segments.*hold: 30 min"):
        load_temperature(path)


def test_thermometer_lag_and_reference_are_read(tmp_path):
    path = tmp_path / "own.yaml"
    path.write_text(
        "start: 25 degC\nreference: 20 degC\nsensor_lag: 2 min\nthermometer_offset: -0.5 degC\n"
        "thermometer_noise: 0.1 degC\nthermometer_resolution: 0.25 degC\n"
    )
    profile = load_temperature(path)
    assert (profile.reference_degc, profile.sensor_lag_s) == (20.0, 120.0)
    assert (profile.offset, profile.noise, profile.resolution) == (-0.5, 0.1, 0.25)
