"""Compensation is the inverse of the sensor, not of its first order."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sdimu_calibration.core.compensation import compensate, compensator, heat_since, linear_model
from sdimu_calibration.core.compensation.reads import reads, samples_motion
from sdimu_calibration.core.effects import registry, selection
from sdimu_calibration.core.origin import Origin
from sdimu_calibration.core.recording import DataError, TemperatureLog
from sdimu_calibration.core.specification import ImuSpecification
from sdimu_calibration.core.units import to_si
from sdimu_sim.core.generator import response
from sdimu_sim.core.samples import TrueSamples
from sdimu_sim.core.truth import ImuTruth

from .conftest import BASELINE

IMU = ImuSpecification("mems", to_si(0.005, "deg/s/sqrt(Hz)"), to_si(100, "ug/sqrt(Hz)"), grade="mems")
DT = 0.01
ROUNDING = 1e-11
"""Of numbers up to 20 through products of a few 3 x 3 matrices."""


READS = {name: reads(registry.get(name)) for name in registry.names()}
"""Variables of the motion on which each effect of the catalogue depends."""


def motions(n=400, seed=2):
    """Rates up to some hundred deg/s, forces up to some g."""
    rng = np.random.default_rng(seed)
    return 2.0 * rng.standard_normal((n, 3)), 15.0 * rng.standard_normal((n, 3)), np.arange(1, n + 1) * DT


def measured(result, omega, force):
    """What the simulated sensor (written apart from the estimator) shows of its own coefficients."""
    none = 0 * omega.T
    true = TrueSamples(omega.T, force.T, omega.T, none, none, force.T / -9.8, np.zeros((3, 3, len(omega))))
    truth = ImuTruth(coefficients=dict(zip(result.names, result.values, strict=True)))
    out = response(truth, true).T
    return out[:, :3], out[:, 3:]


def test_the_sensor_of_the_simulator_is_undone_exactly_at_errors_of_percents(make_result):
    result = make_result(BASELINE)
    assert np.abs(result.values[3:6]).max() > 0.01, "the errors are of percents"
    omega, force, t = motions()
    linear = linear_model(result)
    # Its input axes are of unit length by rotation, ours are 1 + scale and small angles: compare on our matrices.
    w = omega @ linear.gyro.T + force @ linear.by_force.T + linear.gyro_bias
    f = force @ linear.accel.T + linear.accel_bias
    done = compensate(compensator(result, IMU), t, DT, w, f)
    np.testing.assert_allclose(done.omega_ib_b, omega, atol=ROUNDING)
    np.testing.assert_allclose(done.f_ib_b, force, atol=ROUNDING)


def test_the_simulated_imu_is_undone_to_the_second_order_of_its_axes(make_result):
    # The simulator turns unit axes by the misalignment, exactly; the model's coefficients are first order in the angle,
    # so what is left is its square: (1e-3)^2 of the largest vector.
    result = make_result(BASELINE, size=0.03)
    omega, force, t = motions()
    done = compensate(compensator(result, IMU), t, DT, *measured(result, omega, force))
    angle = np.abs([v for n, v in zip(result.names, result.values, strict=True) if "misalignment" in n]).max()
    assert np.abs(done.f_ib_b - force).max() < 4.0 * angle**2 * np.abs(force).max()
    assert np.abs(done.omega_ib_b - omega).max() < 4.0 * angle**2 * np.abs(omega).max()


@pytest.mark.parametrize("effect", [n for n, read in READS.items() if read <= {"w", "f"} and n not in BASELINE])
def test_an_effect_of_rate_and_force_is_undone_with_the_baseline(make_result, effect):
    result = make_result((*BASELINE, effect), size=0.2)
    # A dead band of MEMS size swallows rates that are then unknown: test it where it can be inverted.
    result.values[-3:] *= 0.005 if effect == "gyro_dead_band" else 1.0
    omega, force, t = motions()
    omega = 0.15 * omega  # the sizes of the catalogue are those of slow tables: a cubic term must stay a small one
    using = compensator(result, IMU)
    zero = np.zeros(len(t))
    values = using.model.regressors(samples_motion(t, zero + DT, omega, force, zero, zero))
    error = using.model.errors(values, result.values)
    done = compensate(using, t, DT, omega + error[:, :3], force + error[:, 3:])
    assert not using.left_out
    np.testing.assert_allclose(done.omega_ib_b, omega, atol=ROUNDING)
    np.testing.assert_allclose(done.f_ib_b, force, atol=ROUNDING)


def test_temperature_counts_from_the_start_of_the_calibrated_recording(make_result):
    result = make_result((*BASELINE, "accel_bias_temperature"), start_temperature_degc=25.0)
    omega, force, t = motions()
    using = compensator(result, IMU, has_temperature=True)
    log = TemperatureLog(np.array([0.0, 10.0]), np.array([35.0, 35.0]))
    warm = compensate(using, t, DT, omega, force, heat_since(log, t, using.start_temperature, causal=True))
    cold = compensate(using, t, DT, omega, force)
    moved = (cold.f_ib_b - warm.f_ib_b) @ linear_model(result).accel.T
    np.testing.assert_allclose(moved, np.broadcast_to(10.0 * result.values[-3:], moved.shape), rtol=1e-9)


def test_temperatures_far_from_those_of_the_calibration_are_told(make_result):
    result = make_result((*BASELINE, "accel_scale_temperature_squared"), start_temperature_degc=25.0)
    result = replace(result, origin=Origin(temperature_low_degc=-10.0, temperature_high_degc=40.0))
    using = compensator(result, IMU, has_temperature=True)
    assert using.beyond(np.array([-12.0, 43.0])) == ""
    assert "-30.0 to 20.0 degC" in using.beyond(np.array([-30.0, 20.0]))
    assert "-10.0 to 40.0 degC" in using.beyond(np.array([60.0]))
    # Nothing that follows the temperature, or nobody who says where it was: nothing to tell.
    plain = replace(make_result(BASELINE, start_temperature_degc=25.0), origin=result.origin)
    assert compensator(plain, IMU, has_temperature=True).beyond(np.array([99.0])) == ""
    unknown = compensator(replace(result, origin=Origin()), IMU, has_temperature=True)
    assert unknown.beyond(np.array([99.0])) == ""


@pytest.mark.parametrize("name", [n for n, read in READS.items() if read >= {"temperature"}])
def test_what_follows_the_temperature_is_undone_at_any(make_result, name):
    result = make_result((*BASELINE, name), size=0.2, start_temperature_degc=25.0)
    omega, force, t = motions()
    heat, rate = np.linspace(-40.0, 40.0, len(t)), np.full(len(t), 0.02)
    using = compensator(result, IMU, has_temperature=True)
    assert not using.left_out
    seen = samples_motion(t, 0.0 * t + DT, omega, force, heat, rate)
    error = using.model.errors(using.model.regressors(seen), result.values)
    done = compensate(using, t, DT, omega + error[:, :3], force + error[:, 3:], (heat, rate))
    np.testing.assert_allclose(done.omega_ib_b, omega, atol=ROUNDING)
    np.testing.assert_allclose(done.f_ib_b, force, atol=ROUNDING)


def test_a_variant_whose_key_is_in_the_result_is_compensated(make_result):
    effect = selection.resolve("gyro_bias_warm_up(tau=300 s)")
    result = make_result((*BASELINE, effect.key))
    using = compensator(result, IMU, same_start=True)
    assert using.left_out == ()
    assert len(using.coefficients) == 33
    assert compensator(result, IMU).left_out == (
        f"{effect.key} (a function of time in the calibrated recording; --same-start where this recording is that one)",
    )
    t = np.array([10.0, 310.0])
    seen = samples_motion(t, 0.0 * t, np.zeros((2, 3)), np.zeros((2, 3)), 0.0 * t, 0.0 * t)
    warm_up = using.model.regressors(seen)[:, -3:]
    np.testing.assert_allclose(warm_up[1] / warm_up[0], np.exp(-1.0), rtol=1e-12)


@pytest.mark.parametrize(
    ("effect", "reason"),
    [
        ("gyro_bias_temperature", "needs the temperature of the IMU"),
        ("accel_size", "needs the angular acceleration"),
        ("gyro_magnetic", "needs the attitude"),
        ("accel_bias_ramp", "a function of time"),
        ("accel_bias_warm_up", "does not say its tau"),
        ("gyro_bias_in_motion", "when the table rests"),
        ("gyro_lost_data", "a fault of the recording"),
        ("gyro_hysteresis", "history of turns"),
    ],
)
def test_what_samples_do_not_show_is_left_out_and_said(make_result, effect, reason):
    using = compensator(make_result((*BASELINE, effect)), IMU)
    assert len(using.left_out) == 1
    assert effect in using.left_out[0]
    assert reason in using.left_out[0]
    assert len(using.coefficients) == 30


def test_functions_of_time_are_taken_where_the_start_is_alike(make_result):
    result = make_result((*BASELINE, *(f"gyro_bias_warm_up_{a}(tau=300 s)" for a in "xyz")))
    assert len(compensator(result, IMU).left_out) == 3
    using = compensator(result, IMU, same_start=True)
    assert not using.left_out
    omega, force, _ = motions(2)
    early, late = (
        compensate(using, np.full(2, t), DT, omega, force).omega_ib_b @ linear_model(result).gyro.T
        for t in (0.5 * DT, 300.0 + 0.5 * DT)
    )
    np.testing.assert_allclose((late - early)[0], (1.0 - np.exp(-1.0)) * result.values[-3:], rtol=1e-9)


def test_covariance_is_what_draws_of_coefficients_and_noise_scatter(make_result):
    result = make_result(BASELINE, size=1.0)
    omega, force, t = motions(1)
    using = compensator(result, IMU)
    rng = np.random.default_rng(11)
    draws = 4000
    root = np.linalg.cholesky(result.covariance + 1e-30 * np.eye(30))
    scatter = np.empty((draws, 6))
    # Matrices and biases are linear in the coefficients: one of each, then sums.
    parts = [linear_model(replace(result, values=unit)) for unit in np.eye(30)]
    for k in range(draws):
        drawn = result.values + root @ rng.standard_normal(30)
        gyro, accel, by_force, gyro_bias, accel_bias = (
            np.tensordot(drawn, np.array([getattr(part, name) for part in parts]) - base, axes=1) + base
            for name, base in (
                ("gyro", np.eye(3)),
                ("accel", np.eye(3)),
                ("by_force", 0.0),
                ("gyro_bias", 0.0),
                ("accel_bias", 0.0),
            )
        )
        noise = rng.standard_normal(6) * np.sqrt(using.noise / DT)
        f = np.linalg.solve(accel, force[0] + noise[3:] - accel_bias)
        w = np.linalg.solve(gyro, omega[0] + noise[:3] - gyro_bias - by_force @ f)
        scatter[k] = np.concatenate([w, f])
    done = compensate(using, t, DT, omega, force)
    for found, claimed in ((scatter[:, :3], done.omega_covariance[0]), (scatter[:, 3:], done.f_covariance[0])):
        sample = np.cov(found.T)
        scale = np.sqrt(np.outer(np.diag(claimed), np.diag(claimed)))
        # Standard error of a covariance of 4000 draws is at most sqrt(2 / 4000) of the scale: 5 of them.
        assert np.abs((sample - claimed) / scale).max() < 5.0 * np.sqrt(2.0 / draws)


def test_an_error_that_changes_faster_than_the_rate_is_refused(make_result):
    result = make_result((*BASELINE, "gyro_scale_quadratic"))
    result.values[-3:] = 5.0
    with pytest.raises(DataError, match="cannot be inverted"):
        compensate(compensator(result, IMU), np.array([1.0]), DT, np.full((1, 3), -3.0), np.ones((1, 3)))


def test_an_effect_of_no_catalogue_asks_for_its_file(make_result):
    result = make_result(BASELINE)
    odd = replace(result, model=(*result.model[:-1], "my_effect_k"))
    with pytest.raises(DataError, match="--effect"):
        compensator(odd, IMU)


def test_time_dependence_is_found_by_trying_it():
    for name in registry.names():
        assert ("t" in reads(registry.get(name))) == any(
            word in name for word in ("ramp", "warm_up", "step", "random_walk", "lost_data")
        ), name


def test_matrices_hold_what_is_straight_and_name_what_is_not(make_result):
    result = make_result((*BASELINE, "accel_quadratic", "gyro_g_sensitivity"))
    linear = linear_model(result)
    assert linear.left == tuple(p.name for p in selection.resolve("accel_quadratic").parameters)
    value = dict(zip(result.names, result.values, strict=True))
    # Row x of Kim, Song & Lyou: 1 + T_x, p_xz, -p_xy.
    expected = [1 + value["gyro_scale_x"], value["gyro_misalignment_xz"], -value["gyro_misalignment_xy"]]
    np.testing.assert_allclose(linear.gyro[0], expected, rtol=1e-12)
    assert np.allclose(np.triu(linear.accel, 1), 0.0), "the accelerometers' own frame"
