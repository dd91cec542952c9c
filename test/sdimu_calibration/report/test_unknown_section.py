"""An error that no effect explains is drawn against what it follows, where it acts, with its band."""

from __future__ import annotations

import numpy as np
import pytest

from sdimu_calibration.core.noise_term import ATTITUDE, RATE, TEMPERATURE
from sdimu_calibration.core.posterior.unknown import UnknownFunction
from sdimu_calibration.report.unknown_section import followed

TURNING = np.array([False, True, False, True])
VARIABLE = {
    ATTITUDE: np.arange(12.0).reshape(4, 3) / 12.0,
    RATE: np.radians(np.arange(12.0)).reshape(4, 3),
    TEMPERATURE: np.arange(4.0)[:, None],
}
SHOWN = {ATTITUDE: VARIABLE[ATTITUDE], RATE: np.arange(12.0).reshape(4, 3)[TURNING], TEMPERATURE: [[0.0], [2.0]]}


@pytest.mark.parametrize("kind", [ATTITUDE, RATE, TEMPERATURE])
def test_each_axis_is_drawn_against_each_component_in_customary_units(kind):
    mean = np.arange(12.0).reshape(4, 3)
    figure = followed(UnknownFunction("gyro", kind, VARIABLE[kind], TURNING, np.radians(mean) / 3600.0, 0.0 * mean))
    traces = figure.as_plotly().data
    at = {ATTITUDE: TURNING | True, RATE: TURNING, TEMPERATURE: ~TURNING}[kind]
    columns = VARIABLE[kind].shape[1]
    assert len(traces) == 3 * columns
    for k, trace in enumerate(traces):
        np.testing.assert_allclose(trace.x, np.asarray(SHOWN[kind])[:, k % columns])
        np.testing.assert_allclose(trace.y, mean[at, k // columns])


def test_only_the_sensors_that_have_it_are_drawn():
    mean = np.arange(12.0).reshape(4, 3)
    found = UnknownFunction("accel", ATTITUDE, VARIABLE[ATTITUDE], TURNING, mean, 0.0 * mean, axes=(1,))
    figure = followed(found).as_plotly()
    assert len(figure.data) == 3
    assert figure.layout.yaxis.title.text == "accel y (ug)"
    for trace in figure.data:
        np.testing.assert_allclose(trace.y, mean[:, 1] / 9.80665e-6)
        assert list(trace.marker.symbol) == ["circle", "circle-open", "circle", "circle-open"]
