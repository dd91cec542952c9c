"""Priors in the accelerometers' frame: no combination of coefficients is known better than in the frame of the case."""

import numpy as np
import pytest

from sdimu_calibration.core.effects import body_frame, imu_model
from sdimu_calibration.core.effects.accelerometer_frame import FRAME, accelerometer_frame_model
from sdimu_calibration.storage.files.config import load_imu, load_model


@pytest.fixture(scope="module", params=["mems_consumer", "mems_industrial"])
def priors(request):
    """Covariance of the prior as turned, and what the model takes, of the coefficients that both have; names."""
    imu = load_imu(request.param)
    asked = imu_model.build(list(load_model("baseline").effects), imu)
    inner = accelerometer_frame_model(asked, imu).inner
    J = body_frame.frame_jacobian(asked.names, FRAME, by_temperature=False)
    names = [n for n in asked.names if n in inner.names]
    at = [asked.names.index(n) for n in names]
    P = (J @ np.diag(asked.stated**2) @ J.T)[np.ix_(at, at)]
    return P, np.diag([inner.prior[inner.names.index(n)] ** 2 for n in names]), names


def test_no_combination_is_known_better_than_before_the_turn(priors):
    P, D, _ = priors
    unit = 1.0 / np.sqrt(np.diag(P))
    assert np.linalg.eigvalsh((D - P) * np.outer(unit, unit))[0] > -1e-12


def test_the_angle_of_the_frame_has_the_sigma_that_it_had(priors):
    """Signed as they share the angle, the sum of the three misalignments that a turn about X is in."""
    P, D, names = priors
    three = [names.index(n) for n in ("gyro_misalignment_xz", "gyro_misalignment_yz", "accel_misalignment_yz")]
    shared = P[np.ix_(three, three)]
    sign = np.sign(shared[0])
    assert sign @ D[np.ix_(three, three)] @ sign == pytest.approx(sign @ shared @ sign, rel=1e-9)


def test_what_the_turn_does_not_touch_keeps_its_sigma(priors):
    P, D, names = priors
    apart = [k for k, n in enumerate(names) if "misalignment" not in n]
    assert len(apart) > 10
    np.testing.assert_allclose(np.diag(D)[apart], np.diag(P)[apart], rtol=1e-12)
