"""The true sensor: axes that are really turned, and the same sensor in the frame of its accelerometers."""

import numpy as np
import pytest

from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.specification import ImuSpecification
from sdimu_sim.core.truth import COEFFICIENTS, ImuTruth, draw_coefficients, draw_mount, in_body_frame, input_axes

DTG = ImuSpecification(
    "dtg",
    0.0,
    0.0,
    {
        "gyro_bias": 5e-6,
        "gyro_scale": 1.5e-4,
        "gyro_misalignment": 3e-4,
        "gyro_mass_unbalance": 5e-6,
        "accel_bias": 1.5e-3,
        "accel_scale": 1.5e-4,
        "accel_misalignment": 3e-4,
    },
)


def matrix(triad, c):
    """I + E of the error equations of doc/conventions.md, written out here from that page."""
    s, m = f"{triad}_scale_", f"{triad}_misalignment_"
    return np.eye(3) + np.array(
        [
            [c[s + "x"], c[m + "xz"], -c[m + "xy"]],
            [-c[m + "yz"], c[s + "y"], c[m + "yx"]],
            [c[m + "zy"], -c[m + "zx"], c[s + "z"]],
        ]
    )


def test_there_are_thirty_names():
    assert len(set(COEFFICIENTS)) == 30


@pytest.mark.parametrize("triad", ["gyro", "accel"])
def test_input_axes_have_the_length_of_their_scale(triad):
    built = draw_coefficients(DTG, 5)
    length = np.linalg.norm(input_axes(triad, built), axis=1)
    np.testing.assert_allclose(length, [1 + built[f"{triad}_scale_{i}"] for i in "xyz"], rtol=1e-15)


@pytest.mark.parametrize("triad", ["gyro", "accel"])
def test_frame_prior_states_the_input_axes_exactly(triad):
    built = {k: 30 * v for k, v in draw_coefficients(DTG, 5).items()}
    np.testing.assert_allclose(matrix(triad, in_body_frame(built, "prior")), input_axes(triad, built), atol=1e-16)


def test_frames_differ_by_one_rotation_common_to_both_triads():
    built = {k: 30 * v for k, v in draw_coefficients(DTG, 7).items()}
    triad = in_body_frame(built, "accelerometer_triad")
    rotations = [np.linalg.solve(matrix(s, triad), input_axes(s, built)) for s in ("gyro", "accel")]
    np.testing.assert_allclose(rotations[0], rotations[1], atol=1e-14)
    np.testing.assert_allclose(rotations[0] @ rotations[0].T, np.eye(3), atol=1e-14)
    assert np.linalg.det(rotations[0]) > 0


def test_accelerometer_triad_has_x_along_its_x_axis_and_y_in_its_plane():
    built = draw_coefficients(DTG, 9)
    triad = in_body_frame(built, "accelerometer_triad")
    assert [triad[f"accel_misalignment_{p}"] for p in ("xy", "xz", "yx")] == [0.0, 0.0, 0.0]
    # Lengths of axes and angles between them belong to the sensor, not to the frame.
    M, axes = matrix("accel", triad), input_axes("accel", built)
    np.testing.assert_allclose(M @ M.T, axes @ axes.T, atol=1e-15)


def test_mass_unbalance_turns_with_the_frame_by_first_order_of_its_angle():
    built = draw_coefficients(DTG, 9)
    prior, triad = in_body_frame(built, "prior"), in_body_frame(built, "accelerometer_triad")
    names = [n for n in COEFFICIENTS if "unbalance" in n]
    largest = max(abs(prior[n]) for n in names)
    # Three sigma of three angles of an arcminute.
    assert max(abs(prior[n] - triad[n]) for n in names) < 3 * 3 * 3e-4 * largest


def test_a_group_without_prior_draws_zero_and_leaves_the_others_alone():
    few = ImuSpecification("few", 0.0, 0.0, {"accel_bias": DTG.prior["accel_bias"]})
    drawn, all_of_them = draw_coefficients(few, 3), draw_coefficients(DTG, 3)
    assert drawn["accel_bias_y"] == all_of_them["accel_bias_y"] != 0.0
    assert drawn["gyro_scale_z"] == 0.0


def test_draws_have_the_spread_of_the_specification():
    values = np.array([[draw_coefficients(DTG, s)[n] for n in COEFFICIENTS] for s in range(200)])
    sigma = np.array([DTG.prior[n.rsplit("_", 1)[0]] for n in COEFFICIENTS])
    normal = (values / sigma).ravel()
    # Five sigma of mean and variance of 6000 normal numbers.
    assert abs(normal.mean()) < 5 / np.sqrt(normal.size)
    assert abs(normal.var() - 1) < 5 * np.sqrt(2 / normal.size)


def test_mount_is_drawn_within_its_limit():
    drawn = np.array([draw_mount(0.05, s) for s in range(100)])
    assert np.abs(drawn).max() <= 0.05
    assert np.abs(drawn).max(axis=0).min() > 0.04


def test_unknown_names_and_frames_are_refused():
    with pytest.raises(DataError, match="gyro_bais_x"):
        ImuTruth(coefficients={"gyro_bais_x": 1.0})
    with pytest.raises(DataError, match="accelerometer_triad or prior"):
        in_body_frame({}, "table")
