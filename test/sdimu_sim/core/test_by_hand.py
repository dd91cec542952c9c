"""A simulated hand: attitude and rate are functions of time that belong together, and rests are rests."""

import numpy as np
import pytest

from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.rotation import quaternion_matrix, rotation_vector
from sdimu_calibration.core.specification import ImuSpecification, Site
from sdimu_sim.core.by_hand import ByHand, against_gravity, by_hand_motion, by_hand_recording
from sdimu_sim.core.generator import gravity_of

PERFECT = ImuSpecification("perfect", 0.0, 0.0, {})
SITE = Site(np.radians(36.4), 80.0)


def test_rate_is_the_derivative_of_attitude():
    motion = by_hand_motion(ByHand(6, PERFECT, SITE, seed=3))
    C = np.array([quaternion_matrix(q) for q in motion.q_nt])
    h = np.diff(motion.t)
    k = np.flatnonzero((h[:-1] < 0.006) & (h[1:] < 0.006)) + 1
    middle = np.array([rotation_vector(C[i - 1].T @ C[i + 1]) / (motion.t[i + 1] - motion.t[i - 1]) for i in k])
    # Central differences: h^2 / 6 times the second derivative of the rate, of tremor 10 deg/s at 12 Hz.
    bound = 0.005**2 / 6.0 * np.radians(15.0) * (2.0 * np.pi * 12.0) ** 2 + 2e-3
    assert np.max(np.abs(middle - motion.omega_nt_t[k])) < bound
    assert np.max(np.abs(motion.omega_nt_t)) > np.radians(60.0)


def test_perfect_samples_show_gravity_in_rests_and_more_in_turns():
    recording, truth = by_hand_recording(ByHand(12, PERFECT, SITE, seed=4))
    size = np.linalg.norm(recording.f_ib_b, axis=1)
    still = np.linalg.norm(recording.omega_ib_b, axis=1) < 1e-4
    assert 0.3 < still.mean() < 0.95
    np.testing.assert_allclose(size[still], gravity_of(SITE), rtol=1e-9)
    assert np.max(np.abs(size - gravity_of(SITE))) > 0.5
    assert truth.plan == "12 attitudes by hand"


def test_attitudes_differ_from_seed_to_seed_and_are_the_same_for_one():
    one, same, other = (by_hand_motion(ByHand(5, PERFECT, SITE, seed=s)) for s in (1, 1, 2))
    assert np.array_equal(one.q_nt, same.q_nt)
    assert not np.array_equal(one.q_nt[:2], other.q_nt[:2])


def test_another_gravity_lengthens_the_axes():
    _, truth = by_hand_recording(ByHand(3, ImuSpecification("s", 0.0, 0.0, {"accel_scale": 0.02}), SITE, seed=1))
    stated = against_gravity(truth, 9.80665, 9.8)
    for axis in "xyz":
        before, after = (t.imu.coefficients[f"accel_scale_{axis}"] for t in (truth, stated))
        # The same reading for the same force.
        assert (1.0 + after) * 9.80665 == pytest.approx((1.0 + before) * 9.8, rel=1e-12)


def test_one_attitude_is_no_run():
    with pytest.raises(DataError, match="1 attitudes"):
        by_hand_recording(ByHand(1, PERFECT, SITE))
