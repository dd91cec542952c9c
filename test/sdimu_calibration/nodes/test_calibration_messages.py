"""What people and programs read of an estimate: sigmas in words, the twist in the frame that it names."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from sdimu_calibration.core.rotation import quaternion_matrix
from sdimu_calibration.nodes.calibration_messages import estimates, navigation


def test_estimates_say_value_sigma_and_unit_in_words():
    names, units = ("gyro_bias_x", "accel_scale_y"), ("deg/h", "ppm")
    values, sigmas = np.array([np.radians(0.02) / 3600.0, -3e-5]), np.array([np.radians(0.0011) / 3600.0, 2e-6])
    first, second = estimates(5, names, values, np.diag(sigmas**2), units).status
    assert (first.name, first.message) == ("gyro_bias_x", "0.02 +- 0.0011 deg/h")
    assert {v.key: v.value for v in second.values} == {"value": "-30", "sigma": "2", "unit": "ppm"}


def test_the_twist_of_the_navigation_is_along_the_axes_of_the_child_frame():
    q_nb = np.array([0.5, 0.5, -0.5, 0.5])
    P = np.diag(np.arange(1.0, 10.0))
    estimate = SimpleNamespace(
        position_error_m=np.zeros(3),
        velocity=np.array([1.0, 2.0, 3.0]),
        q_nb=q_nb,
        navigation_covariance=P,
        body_frame="accelerometer_triad",
    )
    message = navigation(7, estimate)
    assert (message.header.frame_id, message.child_frame_id) == ("ned", "imu_accelerometer_triad")
    assert navigation(7, estimate, "map_ned", "my_imu").child_frame_id == "my_imu"
    linear = message.twist.twist.linear
    C_nb = quaternion_matrix(q_nb)
    np.testing.assert_allclose(C_nb @ [linear.x, linear.y, linear.z], [1.0, 2.0, 3.0], atol=1e-15)
    twist = np.array(message.twist.covariance).reshape(6, 6)[:3, :3]
    np.testing.assert_allclose(C_nb @ twist @ C_nb.T, np.diag([4.0, 5.0, 6.0]), atol=1e-14)
