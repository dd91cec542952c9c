"""Rests are found from samples alone, with the noise learned from them."""

import numpy as np
import pytest

from sdimu_calibration.core.data.static_detection import detect_static
from sdimu_calibration.core.data.windows import block_means
from sdimu_calibration.core.recording import DataError, Recording
from sdimu_calibration.core.specification import ImuSpecification
from sdimu_sim.core.by_hand import ByHand, by_hand_motion, by_hand_recording

GYRO, ACCEL = 1e-4, 1.5e-3
IMU = ImuSpecification("quiet", GYRO, ACCEL, {"gyro_bias": 0.02, "accel_bias": 0.2})


@pytest.mark.parametrize("seed", [1, 2, 3, 4])
def test_every_rest_is_found_and_lies_inside_the_true_one(site, seed):
    run = ByHand(25, IMU, site, seed=seed, rest_s=(1.0, 5.0))
    recording, _ = by_hand_recording(run)
    motion = by_hand_motion(run)
    still = ~motion.omega_nt_t.any(axis=1)
    at = np.flatnonzero(still[:-1] & still[1:])
    rests = detect_static(recording)
    assert len(rests) == len(at) == run.rests
    begin, end = recording.t[rests.first], recording.t[rests.last - 1]
    # A turn of least jerk begins with its third derivative: for a tenth of a second it is below the noise.
    assert (begin > motion.t[at] - 0.1).all()
    assert (end < motion.t[at + 1] + 0.1).all()
    assert (end - begin > motion.t[at + 1] - motion.t[at] - 0.5).all()


def test_noise_is_learned_to_its_statistics(site):
    recording, _ = by_hand_recording(ByHand(40, IMU, site, seed=5))
    rests = detect_static(recording)
    # Some 200 blocks of half a second, three axes: 1 / sqrt(2 * 600) of it, three times.
    assert abs(rests.gyro_white_noise / GYRO - 1.0) < 0.1
    assert abs(rests.accel_white_noise / ACCEL - 1.0) < 0.1


def test_a_slow_even_turn_about_the_vertical_is_no_rest():
    rng = np.random.default_rng(1)
    t = np.arange(1, 6001) * 0.01
    w = 1e-3 * rng.standard_normal((6000, 3))
    w[2000:3000, 2] += np.radians(5.0)
    f = np.array([0.0, 0.0, -9.8]) + 0.01 * rng.standard_normal((6000, 3))
    rests = detect_static(Recording(0, t, w, f))
    inside = (rests.first < 2950) & (rests.last > 2050)
    assert not inside.any()


def test_a_hand_that_never_rests_is_told():
    t = np.arange(1, 2001) * 0.01
    w = np.sin(2.0 * np.pi * t[:, None] * (0.05 + 0.3 * t[:, None] / 20.0) + np.arange(3.0)) * np.exp(0.1 * t[:, None])
    with pytest.raises(DataError, match="no rest"):
        detect_static(Recording(0, t, 3.0 * w, np.cumsum(w, axis=0)))


def _stand(jolt: np.ndarray, way: np.ndarray, seconds: float = 2.0) -> Recording:
    """Two spells of 4 s on the bench about a gap with a jolt of `jolt` (m/s^2) and turning at `way` (rad/s), 100 Hz."""
    rng = np.random.default_rng(3)
    t = np.arange(1, round(100 * (8.0 + seconds)) + 1) * 0.01
    w, f = GYRO * 10.0 * rng.standard_normal((len(t), 3)), ACCEL * 10.0 * rng.standard_normal((len(t), 3))
    gap = slice(400, 400 + round(100 * seconds))
    w[gap] += way
    f += [0.0, 0.0, -9.8]
    f[gap] += jolt
    return Recording(0, t, w, f)


def _wave(amplitude: float, seconds: float = 2.0) -> np.ndarray:
    """A rate about x that comes back to the attitude that it left, shape (n, 3)."""
    t = np.arange(round(100 * seconds)) * 0.01
    return np.outer(amplitude * np.sin(2.0 * np.pi * t / seconds), [1.0, 0.0, 0.0])


def test_a_jolt_does_not_cut_a_rest_in_two():
    shake = np.random.default_rng(4).standard_normal((200, 3))
    rests = detect_static(_stand(0.5 * shake, _wave(np.radians(0.5))))
    assert len(rests) == 1
    assert rests.last[0] - rests.first[0] > 900
    # The noise is that of the rest, not of the jolt.
    assert abs(rests.accel_white_noise / ACCEL - 1.0) < 0.3


@pytest.mark.parametrize(
    ("jolt", "way", "seconds"),
    [
        (0.0, np.radians(2.0) * np.array([0.0, 0.0, 1.0]), 2.0),  # turned about the vertical: the same force
        (0.0, _wave(np.radians(30.0)), 2.0),  # lifted and put back
        (1.0, np.zeros(3), 4.0),  # away for long
    ],
)
def test_an_imu_that_was_moved_has_two_rests(jolt, way, seconds):
    shake = jolt * np.random.default_rng(4).standard_normal((round(100 * seconds), 3))
    assert len(detect_static(_stand(shake, way, seconds))) == 2


@pytest.mark.parametrize("width", [1, 7, 100])
def test_means_of_blocks_are_those_of_their_samples_to_the_digit(width):
    values = np.random.default_rng(2).normal([0.0, 1e-3, 9.8], 1.0, (1003, 3))
    whole = len(values) // width * width
    assert np.array_equal(block_means(values, width), values[:whole].reshape(-1, width, 3).mean(axis=1))
