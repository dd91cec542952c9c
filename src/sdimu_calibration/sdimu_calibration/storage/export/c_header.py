"""A C header (C99) that needs nothing else: constants and one function."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.compensation import LinearModel
from sdimu_calibration.storage.export.shared import Source, bent, comments, number

_FUNCTION = """
/* Body rate (rad/s) and specific force (m/s^2) in the body frame named above, from samples in SI. */
static inline void sdimu_compensate(const double rate_measured[3], const double force_measured[3],
                                    double rate[3], double force[3])
{
    double v[3];
    int i, j;

    for (i = 0; i < 3; ++i)
        v[i] = force_measured[i] - sdimu_accel_bias[i];
    for (i = 0; i < 3; ++i) {
        force[i] = 0.0;
        for (j = 0; j < 3; ++j)
            force[i] += sdimu_accel_inverse[i][j] * v[j];
    }
    for (i = 0; i < 3; ++i) {
        v[i] = rate_measured[i] - sdimu_gyro_bias[i];
        for (j = 0; j < 3; ++j)
            v[i] -= sdimu_gyro_by_force[i][j] * force[j];
    }
    for (i = 0; i < 3; ++i) {
        rate[i] = 0.0;
        for (j = 0; j < 3; ++j)
            rate[i] += sdimu_gyro_inverse[i][j] * v[j];
    }
}
"""


def texts(source: Source) -> dict[str, str]:
    """Return the text of the file."""
    linear = source.linear
    use = " * Use: #include this file and call sdimu_compensate for every sample."
    lines = ["/*", *comments(source, " *"), use, " */"]
    lines += ["#ifndef SDIMU_COMPENSATION_H", "#define SDIMU_COMPENSATION_H", ""]
    lines += _matrix("sdimu_gyro_inverse", np.linalg.inv(linear.gyro), "inv(M_g)")
    lines += _matrix("sdimu_gyro_by_force", linear.by_force, "G, (rad/s)/(m/s^2)")
    lines += _matrix("sdimu_accel_inverse", np.linalg.inv(linear.accel), "inv(M_a)")
    lines += _vector("sdimu_gyro_bias", linear.gyro_bias, "rad/s")
    lines += _vector("sdimu_accel_bias", linear.accel_bias, "m/s^2")
    return {"": "\n".join(lines) + _FUNCTION + "\n#endif\n"}


def cannot_hold(linear: LinearModel) -> list[str]:
    """Say what is left out."""
    return bent(linear)


def _matrix(name: str, values: NDArray[Any], what: str) -> list[str]:
    rows = ",\n".join(f"    {_braced(v)}" for v in values)
    return [f"static const double {name}[3][3] = {{ /* {what} */", rows, "};"]


def _vector(name: str, values: Floats, what: str) -> list[str]:
    return [f"static const double {name}[3] = {_braced(values)}; /* {what} */"]


def _braced(values: Floats) -> str:
    return "{" + ", ".join(number(v) for v in values) + "}"
