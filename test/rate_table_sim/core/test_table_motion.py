"""A plan carried out: orientations of the paper, phases, encoders."""

import numpy as np
import pytest

from rate_table_sim.core import Imperfections, TableSpecification, phase_changes, table_motion
from sdimu_calibration.core.plan import Plan, Turn
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.rotation import quaternion_matrix, rotation_matrix
from sdimu_calibration.storage.files.config import load_plan

# Directions of X, Y, Z at the nineteen stops: Kim, Song & Lyou, checked by the right-hand rule.
PAPER = [
    "NED",
    "UEN",
    "DES",
    "UEN",
    "EDN",
    "WUN",
    "EDN",
    "ENU",
    "ESD",
    "ENU",
    "EUS",
    "ESD",
    "EDN",
    "DWN",
    "WUN",
    "UEN",
    "SEU",
    "DES",
    "NED",
]
DIRECTION = {"N": (1, 0, 0), "S": (-1, 0, 0), "E": (0, 1, 0), "W": (0, -1, 0), "D": (0, 0, 1), "U": (0, 0, -1)}


@pytest.fixture(scope="module")
def kim18():
    return table_motion(load_plan("kim18"), TableSpecification(sample_rate_hz=20.0))


def at_stop(motion, stop):
    return quaternion_matrix(motion.q_nt[np.flatnonzero((motion.stop == stop) & motion.dwell)[0]])


@pytest.mark.parametrize("stop", range(19))
def test_stops_point_as_in_the_paper(kim18, stop):
    expected = np.array([DIRECTION[letter] for letter in PAPER[stop]], dtype=float).T
    np.testing.assert_allclose(at_stop(kim18, stop), expected, atol=1e-14)


def test_gimbals_and_turns_about_body_axes_give_the_same_motion(kim18):
    free = table_motion(load_plan("kim18"), TableSpecification(axes=None, sample_rate_hz=20.0))
    same = np.abs(np.sum(kim18.q_nt * free.q_nt, axis=1))
    np.testing.assert_allclose(same, 1.0, rtol=0, atol=1e-14)
    # Angles up to 13 rad leave sines of 1e-15; times 2 deg/s that is nothing.
    np.testing.assert_allclose(kim18.omega_nt_t, free.omega_nt_t, rtol=0, atol=1e-14)


def test_the_test_lasts_as_long_as_its_plan_says(kim18):
    assert kim18.t[-1] == load_plan("kim18").duration_s == 2980.0


def test_rate_is_zero_in_every_dwell_and_only_there_before_the_ends(kim18):
    assert not kim18.omega_nt_t[kim18.dwell].any()
    moving = ~kim18.dwell
    moving[np.flatnonzero(np.diff(kim18.dwell.astype(int)) == -1) + 1] = False  # the first sample of a turn rests
    assert (np.linalg.norm(kim18.omega_nt_t[moving], axis=1) > 0).all()


def test_phases_are_reported_at_every_change_and_each_second(kim18):
    t, dwell, stop = phase_changes(kim18)
    assert t[0] == 0.0
    assert dwell[0]
    assert set(range(2981)) <= set(t)
    np.testing.assert_allclose(t[np.flatnonzero(np.diff(dwell.astype(int)) == -1)[0] + 1], 100.0)
    assert (np.diff(t) > 0).all()
    assert stop[-1] == 18
    # While rotating, the index is that of the stop that was left.
    assert stop[(t > 100) & (t < 145)].max() == 0


def test_encoders_err_without_moving_the_platform(kim18):
    step = np.radians(1 / 3600)
    table = TableSpecification(
        sample_rate_hz=20.0, imperfections=Imperfections(encoder_noise_rad=step, encoder_resolution_rad=step)
    )
    motion = table_motion(load_plan("kim18"), table, seed=3)
    np.testing.assert_array_equal(motion.q_nt, kim18.q_nt)
    counts = motion.encoder_angle / step
    np.testing.assert_allclose(counts, np.round(counts), atol=1e-6)
    # Variance of the noise and of the rounding add; five sigma of a variance over n readings.
    n = counts.size
    variance = np.var((motion.encoder_angle - motion.angle) / step)
    assert variance == pytest.approx(1 + 1 / 12, abs=5 * np.sqrt(2 / n) * (1 + 1 / 12))


def test_base_tilt_turns_everything_alike(kim18):
    tilt = Imperfections(base_tilt_north_rad=1e-3, base_tilt_east_rad=-2e-3)
    motion = table_motion(load_plan("kim18"), TableSpecification(sample_rate_hz=20.0, imperfections=tilt))
    base = rotation_matrix(np.array([1e-3, -2e-3, 0.0]))
    for stop in (0, 5, 18):
        np.testing.assert_allclose(at_stop(motion, stop), base @ at_stop(kim18, stop), atol=1e-14)


def test_a_table_without_gimbals_has_no_gimbal_errors():
    plan = Plan("one", (1.0, 1.0), (Turn("X", 0.1, 0.05),), 1.0)
    wrong = TableSpecification(axes=None, imperfections=Imperfections(wobble_rad=1e-5))
    with pytest.raises(DataError, match="no gimbals"):
        table_motion(plan, wrong)


def test_a_free_table_makes_turns_that_gimbals_cannot():
    plan = Plan("free", (1.0,) * 4, (Turn("X", 0.5, 0.1), Turn("Z", 0.7, 0.1), Turn("Y", -0.3, 0.1)), 1.0)
    motion = table_motion(plan, TableSpecification(axes=None))
    turns = [np.array([0.5, 0, 0]), np.array([0, 0, 0.7]), np.array([0, -0.3, 0])]
    expected = rotation_matrix(turns[0]) @ rotation_matrix(turns[1]) @ rotation_matrix(turns[2])
    np.testing.assert_allclose(at_stop(motion, 3), expected, atol=1e-14)
