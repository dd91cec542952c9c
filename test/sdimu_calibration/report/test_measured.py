"""Measured against predicted: what differs is the residual; turns and table angles stand where they belong."""

from __future__ import annotations

import numpy as np
import pytest

from sdimu_calibration.core.recording import TableLog
from sdimu_calibration.core.units import from_si
from sdimu_calibration.report import data, measured


@pytest.fixture(scope="module")
def found(diagnosis) -> data.Residuals:
    return data.residuals(diagnosis)


@pytest.fixture(scope="module")
def laid_out(diagnosis, found) -> measured.Overlay:
    return measured.overlay(diagnosis, found)


def test_measured_minus_predicted_is_the_residual(laid_out, found):
    for channel in range(12):
        unit = data.CHANNEL_UNITS[channel]
        left = found.after[:, channel] * found.sigma[:, channel] * from_si(1.0, unit)
        for k, stop in enumerate(np.unique(found.stop[np.isfinite(found.after[:, 8])])):
            rows = (found.stop == stop) & np.isfinite(found.after[:, 8])
            values = left[rows][np.isfinite(left[rows])]
            # Of the accelerometers the residual is in ug, the overlay in g: eight digits of a double are left.
            scale = 1e6 if channel >= 9 else 1.0
            difference = scale * (laid_out.measured[k, channel] - laid_out.predicted[k, channel])
            if len(values):
                assert difference == pytest.approx(values.mean(), abs=1e-6)
            else:
                assert np.isnan(difference)


def test_what_the_sensors_say_at_rest_is_gravity_and_earth_rate(laid_out):
    # The specification: bias and scale of 150 ug and 150 ppm, quadratic term of 40 ug/g^2, biases of 1 deg/h.
    assert np.linalg.norm(laid_out.measured[:, 9:], axis=1) == pytest.approx(np.ones(len(laid_out.t)), abs=3e-3)
    assert np.linalg.norm(laid_out.measured[:, 6:9], axis=1) == pytest.approx(np.full(len(laid_out.t), 15.04), abs=6.0)


def test_one_jump_stands_for_each_turn_with_its_axis_and_angle(diagnosis, found):
    jumps = measured.jumps(diagnosis, found)
    # kim18: axes and angles of the plan, the mount of up to 3 deg aside.
    plan = [
        (1, 90),
        (1, 180),
        (1, 180),
        (2, 90),
        (2, 180),
        (2, 180),
        (0, 90),
        (0, 180),
        (0, 180),
        *[(0, 90)] * 3,
        *[(2, 90)] * 3,
        *[(1, 90)] * 3,
    ]
    assert list(jumps.axis) == [axis for axis, _ in plan]
    assert jumps.angle == pytest.approx(np.array([angle for _, angle in plan]), rel=0.01)
    assert list(jumps.stop) == list(range(1, 19))


def test_angles_of_the_table_stay_within_half_a_turn():
    log = TableLog(np.array([0.0, 100.0]), ("outer", "inner"), np.radians([[0.0, -30.0], [720.0, 30.0]]))
    angle = measured.table_angles(log, np.array([10.0, 50.0, 60.0]))
    assert angle == pytest.approx(np.array([[72.0, -24.0], [0.0, 0.0], [72.0, 6.0]]), abs=1e-9)
