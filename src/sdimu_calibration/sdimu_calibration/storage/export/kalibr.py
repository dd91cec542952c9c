"""Kalibr's YAML of an IMU, model ``scale-misalignment``.

Kalibr (ETH Zurich, kalibr_imu_camera_calibration/IccSensors.py, IccScaledMisalignedImu) models

    accelerometer = M f + b          M lower triangular
    gyroscope     = M C_gyro_i w + A C_gyro_i f + b          M lower triangular, C_gyro_i a rotation

which is our model in the frame that the accelerometers define: there M_a is lower triangular, and the gyros' matrix is
factored into a lower triangular one and a rotation. Its files have no biases (they are estimated run by run); ours
add them under names of their own.
"""

from __future__ import annotations

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.compensation import LinearModel
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.storage.export.shared import Source, comments, flow, number

_TRIANGULAR = 1e-12
"""Largest number above the diagonal that is rounding."""


def texts(source: Source) -> dict[str, str]:
    """Return the text of the file."""
    linear = source.linear
    M_a = lower_only(linear, "kalibr", "Kalibr")
    M, C = lower_and_rotation(linear.gyro)
    # A acts on the force seen from the gyros: A C = G.
    A = linear.by_force @ C.T
    lines = comments(source, "#")
    lines += [
        "# Kalibr's names: accelerometers M = M_a; gyroscopes M C_gyro_i = M_g, A C_gyro_i = G. Its files have no",
        "# biases: 'bias' is added. Random walks: of --imu, else learned, else of the IMU file; 0 is not known: set it",
        "# before use.",
        "imu0:",
        "  model: scale-misalignment",
        *(f"  {line}" for line in noise_lines(source)),
        "  rostopic: /imu/data_raw",
        "  time_offset: 0.0",
        f"  update_rate: {number(source.rate_hz)}",
        *block("  T_i_b", np.eye(4)),
        "  accelerometers:",
        *block("    M", M_a),
        f"    bias: {flow(linear.accel_bias)}  # m/s^2",
        "  gyroscopes:",
        *block("    M", M),
        *block("    A", A),
        *block("    C_gyro_i", C),
        f"    bias: {flow(linear.gyro_bias)}  # rad/s",
    ]
    return {"": "\n".join(lines) + "\n"}


def lower_only(linear: LinearModel, form: str, program: str) -> Floats:
    """Return the matrix of the accelerometers, shape (3, 3), for a program that knows it lower triangular alone."""
    if np.abs(np.triu(linear.accel, 1)).max() > _TRIANGULAR:
        raise DataError(
            f"{form}: the result is in body frame '{linear.body_frame}', {program}'s model is that of the "
            "accelerometers (calibrate with body_frame: accelerometer_triad)"
        )
    return np.asarray(np.tril(linear.accel))


def noise_lines(source: Source) -> list[str]:
    """Lines of the four densities, by the names of Kalibr."""
    imu = source.imu
    return [
        f"accelerometer_noise_density: {number(imu.accel_white_noise)}  # m/s^2/sqrt(Hz)",
        f"accelerometer_random_walk: {_walk(imu.accel_random_walk)}  # m/s^3/sqrt(Hz)",
        f"gyroscope_noise_density: {number(imu.gyro_white_noise)}  # rad/s/sqrt(Hz)",
        f"gyroscope_random_walk: {_walk(imu.gyro_random_walk)}  # rad/s^2/sqrt(Hz)",
    ]


def _walk(value: float) -> str:
    return number(value) if value else "0.0"


def lower_and_rotation(matrix: Floats) -> tuple[Floats, Floats]:
    """Factor a matrix (3, 3) into a lower triangular one with a positive diagonal and a rotation: ``matrix = M C``."""
    Q, U = np.linalg.qr(matrix.T)
    sign = np.sign(np.diag(U))
    M, C = (U * sign[:, None]).T, (Q * sign).T
    return np.tril(M), C


def block(name: str, matrix: Floats) -> list[str]:
    """Lines of a matrix under its name, a row each; the name is indented as it stands in the file."""
    indent = " " * (len(name) - len(name.lstrip()))
    return [f"{name}:", *(f"{indent}- {flow(values)}" for values in matrix)]
