"""The gauge: exact against first order, against the simulator's own, and what no frame may change."""

from __future__ import annotations

import numpy as np
import pytest

from sdimu_calibration.core.effects.body_frame import FRAMES, frame_jacobian, values_in_frame
from sdimu_calibration.core.effects.imu_model import build
from sdimu_calibration.core.effects.motion import Motion
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.rotation import rotation_matrix
from sdimu_calibration.core.specification import Model
from sdimu_sim.core.truth import COEFFICIENTS, draw_coefficients, in_body_frame

PINNED = ("accel_misalignment_xy", "accel_misalignment_xz", "accel_misalignment_yx")
TRIAD = "accelerometer_triad"
ARCMIN = np.radians(1 / 60)


def drawn(imu, seed):
    coefficients = draw_coefficients(imu, seed)
    return np.array([coefficients[name] for name in COEFFICIENTS]), coefficients


def sizes(imu):
    return np.array([imu.prior[name.rsplit("_", 1)[0]] for name in COEFFICIENTS])


@pytest.mark.parametrize("seed", range(10))
def test_two_independent_ways_into_the_triad_frame_agree(imu, seed):
    """Truth in the prior's frame, turned here, is the simulator's truth in the triad frame."""
    _, built = drawn(imu, seed)
    prior = in_body_frame(built, "prior")
    mine = values_in_frame(COEFFICIENTS, np.array([prior[n] for n in COEFFICIENTS]), TRIAD)
    theirs = in_body_frame(built, TRIAD)
    # Rounding of matrices of size one.
    np.testing.assert_allclose(mine, [theirs[n] for n in COEFFICIENTS], rtol=0, atol=1e-14)


@pytest.mark.parametrize("seed", range(5))
def test_exact_and_first_order_differ_by_second_order(imu, seed):
    values, _ = drawn(imu, seed)
    J = frame_jacobian(COEFFICIENTS, TRIAD)
    gap = []
    for scale in (1.0, 0.5, 0.25):
        exact = values_in_frame(COEFFICIENTS, scale * values, TRIAD)
        gap.append(np.abs((exact - J @ (scale * values)) / sizes(imu)).max())
    assert gap[0] < 5e-3
    # Halving the coefficients quarters the difference; the mass unbalance is turned by values only, also second order.
    assert gap[0] / gap[1] == pytest.approx(4.0, rel=0.05)
    assert gap[1] / gap[2] == pytest.approx(4.0, rel=0.05)


def test_pinned_combinations_are_zero_and_certain(imu):
    J = frame_jacobian(COEFFICIENTS, TRIAD)
    P = np.diag(sizes(imu) ** 2)
    turned = J @ P @ J.T
    pinned = [COEFFICIENTS.index(name) for name in PINNED]
    assert np.abs(turned[pinned]).max() < 1e-20
    values, _ = drawn(imu, 3)
    np.testing.assert_allclose(values_in_frame(COEFFICIENTS, values, TRIAD)[pinned], 0.0, rtol=0, atol=1e-15)
    # A projection: turning what is turned changes nothing.
    np.testing.assert_allclose(J @ J, J, rtol=0, atol=1e-14)
    again = values_in_frame(COEFFICIENTS, values_in_frame(COEFFICIENTS, values, TRIAD), TRIAD)
    np.testing.assert_allclose(again, values_in_frame(COEFFICIENTS, values, TRIAD), rtol=0, atol=1e-15)


@pytest.mark.parametrize("turn", [(ARCMIN, 0.0, 0.0), (-2 * ARCMIN, ARCMIN, 3 * ARCMIN)])
def test_reported_coefficients_do_not_depend_on_the_frame_in_which_the_sensor_is_stated(imu, turn):
    """Turn the prior's frame: every misalignment changes, the report does not."""
    values, _ = drawn(imu, 4)
    R = rotation_matrix(np.array(turn))
    index = {name: i for i, name in enumerate(COEFFICIENTS)}
    place = {"xy": (0, 2, -1), "xz": (0, 1, 1), "yx": (1, 2, 1), "yz": (1, 0, -1), "zx": (2, 1, -1), "zy": (2, 0, 1)}
    turned = values.copy()
    for triad in ("gyro", "accel"):
        M = np.eye(3)
        for i, axis in enumerate("xyz"):
            M[i, i] += values[index[f"{triad}_scale_{axis}"]]
        for pair, (row, column, sign) in place.items():
            M[row, column] += sign * values[index[f"{triad}_misalignment_{pair}"]]
        N = M @ R.T
        for i, axis in enumerate("xyz"):
            turned[index[f"{triad}_scale_{axis}"]] = N[i, i] - 1.0
        for pair, (row, column, sign) in place.items():
            turned[index[f"{triad}_misalignment_{pair}"]] = sign * N[row, column]
    assert np.abs(turned - values).max() > 0.5 * ARCMIN
    a, b = (values_in_frame(COEFFICIENTS, v, TRIAD) for v in (values, turned))
    unbalance = np.array(["unbalance" in name for name in COEFFICIENTS])
    np.testing.assert_allclose(b[~unbalance], a[~unbalance], rtol=0, atol=1e-14)
    # The six terms of mass unbalance are not closed under a turn: an arcminute of them is lost.
    np.testing.assert_allclose(b[unbalance], a[unbalance], rtol=0, atol=4e-3 * imu.prior["gyro_mass_unbalance"])


def test_places_of_the_misalignments_are_those_of_the_effects(imu):
    """What the frame takes away is a common small turn of both vectors, by the effects' own regressors."""
    sensors = build(("gyro_misalignment", "accel_misalignment"), imu)
    rng = np.random.default_rng(0)
    n = 7
    w, f = rng.standard_normal((n, 3)), rng.standard_normal((n, 3))

    def seen(w, f):
        rest = {name: np.zeros(n) for name in Motion.__dataclass_fields__}
        return Motion(**{**rest, "w": w, "f": f})

    J = frame_jacobian(sensors.names, TRIAD)
    coefficients = ARCMIN * rng.standard_normal(12)
    moved = coefficients - J @ coefficients
    t = np.array([moved[sensors.names.index(f"accel_misalignment_{pair}")] for pair in ("yx", "xy", "xz")])
    errors = sensors.errors(sensors.regressors(seen(w, f)), moved)
    np.testing.assert_allclose(errors[:, :3], -np.cross(t, w), rtol=0, atol=1e-15)
    np.testing.assert_allclose(errors[:, 3:], -np.cross(t, f), rtol=0, atol=1e-15)


def test_frames_without_the_pinned_coefficients_leave_everything_alone():
    names = ("gyro_bias_x", "accel_scale_y")
    for frame in FRAMES:
        np.testing.assert_array_equal(frame_jacobian(names, frame), np.eye(2))
        np.testing.assert_array_equal(values_in_frame(names, np.array([1.0, 2.0]), frame), [1.0, 2.0])


def test_an_unknown_frame_is_refused_by_name():
    with pytest.raises(DataError, match=r"'table' .*accelerometer_triad"):
        frame_jacobian(COEFFICIENTS, "table")
    assert Model(()).body_frame in FRAMES
