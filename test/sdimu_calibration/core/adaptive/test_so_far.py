"""A covariance that goes on move by move is that of the whole test."""

import numpy as np
import pytest

from sdimu_calibration.core.adaptive import ahead, so_far
from sdimu_calibration.core.effects.selection import resolve

from .conftest import ACCELERATION, DWELLS, TURNS, part, perfect_fit

MEMORIES = (
    "gyro_bias_ramp_x",
    "gyro_bias_settling_y(tau=32 s)",
    "accel_play_y(r=0.3 g)",
    "accel_hysteresis_z",
    "gyro_creep_z(tau=32 s)",
    "gyro_bias_wrap_xy",
)


@pytest.mark.parametrize("added", [(), MEMORIES], ids=["baseline", "effects that remember"])
def test_moves_one_after_the_other_end_with_the_covariance_of_the_whole_plan(added):
    at = so_far(perfect_fit(part(2)), [resolve(name) for name in added])
    for turn, dwell in zip(TURNS[1:], DWELLS[2:], strict=True):
        at = ahead(at, turn, dwell, ACCELERATION).end
    whole = perfect_fit(part(5), added)
    assert at.names == whole.names
    unit = np.sqrt(np.diag(whole.estimate_covariance))
    np.testing.assert_allclose(
        at.covariance / np.outer(unit, unit), whole.estimate_covariance / np.outer(unit, unit), atol=1e-5
    )


def test_a_shorter_stop_is_read_from_a_longer_one(first_stop):
    at = so_far(first_stop)
    long, short = (ahead(at, TURNS[0], dwell, ACCELERATION) for dwell in (30.0, 12.0))
    row = int(np.flatnonzero(np.isclose(long.dwell_s, 12.0))[0])
    np.testing.assert_allclose(long.covariance[row], short.end.covariance, rtol=1e-9)
    assert long.elapsed_s[row] == pytest.approx(12.0 + 18.0)


def test_staying_is_a_longer_stop(first_stop):
    stayed = ahead(so_far(first_stop), None, 25.0, ACCELERATION).end
    longer = perfect_fit(part(1).__class__("longer", (45.0,), (), ACCELERATION))
    unit = np.sqrt(np.diag(longer.estimate_covariance))
    np.testing.assert_allclose(np.sqrt(np.diag(stayed.covariance)) / unit, 1.0, rtol=1e-6)


def test_axes_at_right_angles_to_the_first_stop_are_square_and_others_are_not(first_stop):
    at = so_far(first_stop)
    turned = ahead(at, TURNS[1], 10.0, ACCELERATION).end
    half = ahead(turned, TURNS[1].__class__("X", np.pi / 4.0, np.radians(10.0)), 10.0, ACCELERATION).end
    assert at.square
    assert turned.square
    assert not half.square
