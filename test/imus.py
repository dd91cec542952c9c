"""IMUs that several tests simulate and that config/imu does not have."""

from sdimu_calibration.core.specification import ImuSpecification
from sdimu_calibration.core.units import to_si

PERCENTS = ImuSpecification(
    "percents",
    gyro_white_noise=to_si(15, "deg/h/sqrt(Hz)"),
    accel_white_noise=to_si(100, "ug/sqrt(Hz)"),
    prior={
        "gyro_bias": to_si(1, "deg/s"),
        "gyro_scale": 0.02,
        "gyro_misalignment": to_si(2, "deg"),
        "gyro_mass_unbalance": to_si(50, "deg/h/g"),
        "accel_bias": to_si(20, "mg"),
        "accel_scale": 0.02,
        "accel_misalignment": to_si(2, "deg"),
    },
    grade="mems",
)
"""A MEMS IMU as it comes from the factory: errors of per cent."""
