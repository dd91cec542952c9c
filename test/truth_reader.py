"""The truth of a simulated test read back from its file: everything is in it that makes the same recording again."""

import math
from pathlib import Path

import yaml

from sdimu_calibration.core.specification import Site
from sdimu_sim.core.truth import ImuTruth, Truth


def read_truth(path: Path) -> Truth:
    """Read the truth of a test."""
    file = yaml.safe_load(path.read_text())
    noise, electronics = file["noise"], file["electronics"]
    limits = {key: math.inf if value is None else value for key, value in electronics.items()}
    imu = ImuTruth(
        coefficients=file["as_built"],
        mount_rad=tuple(file["mount_rad"]),
        gyro_white_noise=noise["gyro_rad_s_sqrt_hz"],
        accel_white_noise=noise["accel_m_s2_sqrt_hz"],
        effects=tuple(file["effects"]),
        noise=tuple(noise["coloured"]),
        lever_arm_m=tuple(file["lever_arm_m"]),
        magnetic_field=tuple(file["magnetic_field_t"]),
        **limits,
    )
    site = Site(math.radians(file["site"]["latitude_deg"]), file["site"]["height_m"], file["site"]["gravity_m_s2"])
    return Truth(imu, site, file["seed"], file["rate_hz"], file["plan"], file["mean_bias"], file["reference_degc"])
