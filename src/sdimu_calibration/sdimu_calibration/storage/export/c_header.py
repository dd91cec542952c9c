"""A C header (C99) that needs nothing else: constants and one function."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.compensation import Factor, LinearModel, Part
from sdimu_calibration.storage.export.shared import Source, bent, by_temperature, comments, factor_text, number, warm

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
    parts = by_temperature(linear)
    at = _at_temperature(linear, parts) if parts else ""
    return {"": "\n".join(lines) + _FUNCTION + at + "\n#endif\n"}


def cannot_hold(linear: LinearModel) -> list[str]:
    """Say what is left out."""
    return bent(linear) + ([] if by_temperature(linear) else warm(linear))


def _at_temperature(linear: LinearModel, parts: Mapping[Factor, Part]) -> str:
    """Write the constants and the function for any temperature: each part times its factor adds to the matrices."""
    lines = ["", f"#define SDIMU_T0_DEGC {number(linear.temperature_degc or 0.0)}", f"#define SDIMU_PARTS {len(parts)}"]
    lines.append(f"/* Parts: times {', '.join(factor_text(f) for f in parts)} (degC, s); T0 = SDIMU_T0_DEGC. */")
    lines += _matrix("sdimu_gyro", linear.gyro, "M_g at T0") + _matrix("sdimu_accel", linear.accel, "M_a at T0")
    every = parts.values()
    lines += _each("sdimu_gyro_parts", "[3][3]", [_nested(p.gyro) for p in every])
    lines += _each("sdimu_gyro_by_force_parts", "[3][3]", [_nested(p.by_force) for p in every])
    lines += _each("sdimu_accel_parts", "[3][3]", [_nested(p.accel) for p in every])
    lines += _each("sdimu_gyro_bias_parts", "[3]", [_braced(p.gyro_bias) for p in every])
    lines += _each("sdimu_accel_bias_parts", "[3]", [_braced(p.accel_bias) for p in every])
    factors = ", ".join(_C_FACTORS[factor] for factor in parts)
    return "\n".join(lines) + _FUNCTION_AT.replace("FACTORS", factors)


def _each(name: str, shape: str, rows: Sequence[str]) -> list[str]:
    return [f"static const double {name}[SDIMU_PARTS]{shape} = {{", ",\n".join(f"    {r}" for r in rows), "};"]


_C_FACTORS = {
    Factor(1, 0): "x",
    Factor(2, 0): "x * x",
    Factor(3, 0): "x * x * x",
    Factor(0, 1): "temperature_rate",
    Factor(1, 1): "x * temperature_rate",
    Factor(2, 1): "x * x * temperature_rate",
}
_FUNCTION_AT = """
/* Solve m x = v by Cramer's rule. */
static inline void sdimu_solve(double m[3][3], const double v[3], double x[3])
{
    double c[3][3], det = 0.0;
    int i, j;

    for (i = 0; i < 3; ++i)
        for (j = 0; j < 3; ++j)
            c[i][j] = m[(i + 1) % 3][(j + 1) % 3] * m[(i + 2) % 3][(j + 2) % 3]
                    - m[(i + 1) % 3][(j + 2) % 3] * m[(i + 2) % 3][(j + 1) % 3];
    for (j = 0; j < 3; ++j)
        det += m[0][j] * c[0][j];
    for (i = 0; i < 3; ++i)
        x[i] = (c[0][i] * v[0] + c[1][i] * v[1] + c[2][i] * v[2]) / det;
}

/* The same at a temperature (degC) that changes by temperature_rate (degC/s, its mean over the last minute). */
static inline void sdimu_compensate_at(const double rate_measured[3], const double force_measured[3],
                                       double temperature_degc, double temperature_rate,
                                       double rate[3], double force[3])
{
    const double x = temperature_degc - SDIMU_T0_DEGC;
    const double factor[SDIMU_PARTS] = {FACTORS};
    double m[3][3], a[3][3], v[3], u[3], by_force;
    int i, j, k;

    (void)x;
    (void)temperature_rate;
    for (i = 0; i < 3; ++i) {
        v[i] = force_measured[i] - sdimu_accel_bias[i];
        u[i] = rate_measured[i] - sdimu_gyro_bias[i];
        for (k = 0; k < SDIMU_PARTS; ++k) {
            v[i] -= factor[k] * sdimu_accel_bias_parts[k][i];
            u[i] -= factor[k] * sdimu_gyro_bias_parts[k][i];
        }
        for (j = 0; j < 3; ++j) {
            a[i][j] = sdimu_accel[i][j];
            m[i][j] = sdimu_gyro[i][j];
            for (k = 0; k < SDIMU_PARTS; ++k) {
                a[i][j] += factor[k] * sdimu_accel_parts[k][i][j];
                m[i][j] += factor[k] * sdimu_gyro_parts[k][i][j];
            }
        }
    }
    sdimu_solve(a, v, force);
    for (i = 0; i < 3; ++i) {
        for (j = 0; j < 3; ++j) {
            by_force = sdimu_gyro_by_force[i][j];
            for (k = 0; k < SDIMU_PARTS; ++k)
                by_force += factor[k] * sdimu_gyro_by_force_parts[k][i][j];
            u[i] -= by_force * force[j];
        }
    }
    sdimu_solve(m, u, rate);
}
"""


def _matrix(name: str, values: NDArray[Any], what: str) -> list[str]:
    rows = ",\n".join(f"    {_braced(v)}" for v in values)
    return [f"static const double {name}[3][3] = {{ /* {what} */", rows, "};"]


def _vector(name: str, values: Floats, what: str) -> list[str]:
    return [f"static const double {name}[3] = {_braced(values)}; /* {what} */"]


def _braced(values: Floats) -> str:
    return "{" + ", ".join(number(v) for v in values) + "}"


def _nested(rows: Floats) -> str:
    return "{" + ", ".join(map(_braced, rows)) + "}"
