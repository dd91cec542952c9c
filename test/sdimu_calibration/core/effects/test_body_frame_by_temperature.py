"""Axes that turn with the temperature: the frame is that of the accelerometers at every temperature."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sdimu_calibration.core.effect_key import sized
from sdimu_calibration.core.effects import imu_model, registry
from sdimu_calibration.core.effects.accelerometer_frame import accelerometer_frame_model, squares_count
from sdimu_calibration.core.effects.body_frame import (
    frame_jacobian,
    jacobian_at,
    pinned_in,
    temperature_jacobian,
    values_in_frame,
)
from sdimu_calibration.core.rotation import rotation_vector
from sdimu_sim.core.true_coefficients import true_coefficients
from sdimu_sim.core.truth import ImuTruth, draw_coefficients

from ..conftest import BASELINE

TRIAD = "accelerometer_triad"
POWERS = ("_temperature", "_temperature_squared", "_temperature_cubed")
POLYNOMIALS = tuple(f"{base}{power}" for power in POWERS for base in BASELINE if "bias" not in base)
SEEN = tuple(f"gyro_bias_temperature_rate{power}" for power in ("", "_linear", "_quadratic"))
PLACE = {"xy": (0, 2, -1), "xz": (0, 1, 1), "yx": (1, 2, 1), "yz": (1, 0, -1), "zx": (2, 1, -1), "zy": (2, 0, 1)}


@pytest.fixture
def sensors(imu):
    return imu_model.build((*BASELINE, *POLYNOMIALS, *SEEN), imu)


def drawn(sensors, seed, size=1.0):
    return size * sensors.prior * np.random.default_rng(seed).standard_normal(len(sensors.names))


def matrix(named, triad, power=""):
    """Error matrix of a triad by the equations of doc/conventions.md."""
    E = np.diag([named[f"{triad}_scale{power}_{axis}"] for axis in "xyz"])
    for pair, (row, column, sign) in PLACE.items():
        E[row, column] = sign * named[f"{triad}_misalignment{power}_{pair}"]
    return E


def at(named, triad, x):
    return np.eye(3) + matrix(named, triad) + sum(x**n * matrix(named, triad, p) for n, p in enumerate(POWERS, 1))


def test_accelerometer_axes_are_lower_triangular_at_every_temperature(sensors):
    values = drawn(sensors, 1)
    out = dict(zip(sensors.names, values_in_frame(sensors.names, values, TRIAD), strict=True))
    for x in (-50.0, -10.0, 0.0, 20.0, 50.0):
        assert np.abs(np.triu(at(out, "accel", x), 1)).max() < 1e-14


def test_the_turned_sensor_measures_the_same_in_a_frame_that_turns(sensors):
    """Rate and force of the turning frame through the turned sensor are those of the case through the sensor given."""
    values = drawn(sensors, 2)
    old, new = (
        dict(zip(sensors.names, v, strict=True)) for v in (values, values_in_frame(sensors.names, values, TRIAD))
    )
    w, f, rate = np.array([0.02, -0.03, 0.05]), np.array([3.0, -5.0, 8.0]), 2.0 / 60.0

    def frame_at(x):
        """R of v' = R v by the accelerometers' axes at T0 + x, found from what they are."""
        Q, U = np.linalg.qr(at(old, "accel", x).T)
        return (Q * np.sign(np.diag(U))).T

    def bias(named, x):
        return np.array([sum(x**n * named[f"{effect}_{axis}"] for n, effect in enumerate(SEEN)) for axis in "xyz"])

    for x in (-30.0, 0.0, 40.0):
        R = frame_at(x)
        np.testing.assert_allclose(at(new, "accel", x) @ R @ f, at(old, "accel", x) @ f, rtol=0, atol=2e-6)
        np.testing.assert_allclose(at(new, "gyro", x) @ R @ w, at(old, "gyro", x) @ w, rtol=0, atol=2e-8)
        # The frame turns by phi against the case while the temperature rises by `rate` for a second.
        phi = rotation_vector(frame_at(x - 0.5 * rate) @ frame_at(x + 0.5 * rate).T)
        before = at(old, "gyro", x) @ w + rate * bias(old, x)
        after = at(new, "gyro", x) @ (R @ w + phi) + rate * bias(new, x)
        assert np.abs(at(new, "gyro", x) @ phi).max() > 1e-8
        left = (after - at(new, "gyro", x) @ R @ w) - (before - at(old, "gyro", x) @ w)
        # Powers above the third, which no model has, are products of angles of 1e-4: that share of 4e-6 rad/s.
        assert np.abs(left).max() < (4e-10 if x else 1e-11)


def test_two_independent_ways_to_the_truth_agree(sensors, imu):
    """Sizes as built, turned here power by power and there at temperatures over the range."""
    values = drawn(sensors, 3)
    named = dict(zip(sensors.names, values, strict=True))
    shown = {p.name: p.display_unit for effect in sensors.effects for p in effect.parameters}
    effects = tuple(sized(n, v, shown[n]) for n, v in named.items() if "temperature" in n)
    coefficients = draw_coefficients(imu, 3)
    truth = ImuTruth(coefficients=coefficients, effects=effects)
    built = true_coefficients(truth, "prior")
    mine = values_in_frame(sensors.names, np.array([built[n] for n in sensors.names]), TRIAD)
    theirs = true_coefficients(truth, TRIAD)
    sizes = dict(zip(sensors.names, sensors.prior, strict=True))
    for name, value in zip(sensors.names, mine, strict=True):
        # Powers above the fifth, which no model has, are spread over the range by the one and left out by the other.
        assert abs(value - theirs[name]) < 1e-5 * sizes[name], name


def test_first_order_is_the_derivative_about_zero(sensors):
    J = frame_jacobian(sensors.names, TRIAD)
    np.testing.assert_allclose(J, jacobian_at(sensors.names, np.zeros(len(sensors.names)), TRIAD), rtol=0, atol=1e-9)
    np.testing.assert_allclose(J @ J, J, rtol=0, atol=1e-14)


def test_nothing_more_is_pinned_where_the_gyros_hold_the_axes(imu):
    some = imu_model.build((*BASELINE, "accel_misalignment_temperature"), imu).names
    assert len(pinned_in(some)) == 3
    both = imu_model.build((*BASELINE, "accel_misalignment_temperature", "gyro_misalignment_temperature"), imu).names
    assert len(pinned_in(both)) == 6
    assert pinned_in(both, "prior") == ()
    assert pinned_in(tuple(n for n in both if n != "accel_misalignment_xy")) == ()


def test_the_inner_model_is_in_the_frame_at_the_start_and_reported_in_that_at_every_temperature(sensors, imu):
    model = accelerometer_frame_model(sensors, imu)
    pinned = pinned_in(sensors.names)
    assert len(pinned) == 12
    assert set(sensors.names) - set(model.inner.names) == set(pinned[:3])
    inner = 0.3 * drawn(model.inner, 5)
    values = model.values(inner)
    rows = [sensors.names.index(name) for name in pinned]
    assert np.abs(values[rows]).max() < 1e-15
    P = np.diag(model.inner.prior**2)
    C = model.covariance(P, inner)
    assert np.abs(C[rows]).max() == 0.0
    # What is free is known as well as in the frame of the prior, turned about the values themselves.
    J = temperature_jacobian(sensors.names, values)
    np.testing.assert_allclose(J @ C @ J.T, C, rtol=1e-6, atol=1e-25)


def test_the_unit_of_a_temperature_coefficient_says_nothing_of_squares(imu):
    """A rate coefficient in s/K is a large number however small the effect."""
    name = "accel_scale_temperature_rate"
    assert registry.get(name).prior["tactical"] > 3e-3
    assert not squares_count(imu_model.build((*BASELINE, name), replace(imu, grade="tactical")))
