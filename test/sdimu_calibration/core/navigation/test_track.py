"""The attitude of the track is that of the rotation vectors of the cycles, coning included."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
from scipy.spatial.transform import Rotation

from sdimu_calibration.core import earth
from sdimu_calibration.core.navigation.track import integrate


def test_a_cycle_turns_by_its_increment_with_its_coning_and_the_earth_turns_below(general_attitude):
    alpha, coning = np.array([[0.1, -0.2, 0.3]]), np.array([[0.01, 0.02, -0.03]])
    dt, latitude = np.array([2.0]), 0.7
    end = general_attitude.copy()
    (middle,) = integrate(end, SimpleNamespace(alpha=alpha, coning=coning, dt=dt), latitude)
    turned = alpha[0] + coning[0]

    def after(share: float) -> np.ndarray:
        below = Rotation.from_rotvec(-share * dt[0] * earth.earth_rate(latitude)).as_matrix()
        return below @ general_attitude @ Rotation.from_rotvec(share * turned).as_matrix()

    np.testing.assert_allclose(middle, after(0.5), atol=1e-12)
    np.testing.assert_allclose(end, after(1.0), atol=1e-12)
