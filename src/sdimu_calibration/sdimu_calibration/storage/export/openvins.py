"""OpenVINS' YAML of an IMU, ``kalibr_imu_chain.yaml``, model ``kalibr``.

OpenVINS (RPNG, ov_msckf/src/core/VioManagerOptions.h, docs/propagation-analytical.dox) reads Tw, Ta, R_IMUtoGYRO,
R_IMUtoACC and Tg, and corrects

    a = R_IMUtoACC' inv(Ta) (a measured - b_a),     w = R_IMUtoGYRO' inv(Tw) (w measured - b_g - Tg a)

with Tw and Ta lower triangular: our model in the frame that the accelerometers define, M_a = Ta, M_g = Tw R_IMUtoGYRO,
G = Tg. Its reader takes only files whose first line is ``%YAML:1.0``, and no biases: they are added under names that it
passes over.
"""

from __future__ import annotations

import numpy as np

from sdimu_calibration.storage.export.kalibr import block, lower_and_rotation, lower_only, noise_lines
from sdimu_calibration.storage.export.shared import Source, comments, flow, number


def texts(source: Source) -> dict[str, str]:
    """Return the text of the file."""
    linear = source.linear
    Ta = lower_only(linear, "openvins", "OpenVINS")
    Tw, R = lower_and_rotation(linear.gyro)
    lines = [
        "%YAML:1.0",
        *comments(source, "#"),
        "# OpenVINS' names: Ta = M_a, Tw R_IMUtoGYRO = M_g, Tg = G. Its files have no biases: they are added. Random",
        "# walks: of --imu, else learned, else of the IMU file; 0 is not known: set it before use.",
        "imu0:",
        *block("  T_i_b", np.eye(4)),
        *(f"  {line}" for line in noise_lines(source)),
        "  rostopic: /imu/data_raw",
        "  time_offset: 0.0",
        f"  update_rate: {number(source.rate_hz)}",
        '  model: "kalibr"',
        *block("  Tw", Tw),
        *block("  R_IMUtoGYRO", R),
        *block("  Ta", Ta),
        *block("  R_IMUtoACC", np.eye(3)),
        *block("  Tg", linear.by_force),
        f"  gyroscope_bias: {flow(linear.gyro_bias)}  # rad/s",
        f"  accelerometer_bias: {flow(linear.accel_bias)}  # m/s^2",
    ]
    return {"": "\n".join(lines) + "\n"}
