"""Parameter files of PX4 and ArduPilot: offsets and scales along the axes of the sensor.

PX4 (src/lib/sensor_calibration: Accelerometer.hpp, Gyroscope.hpp) corrects, before it rotates to the body,

    force = (measured - offset) * scale,     rate = measured - offset,

each axis by itself; ArduPilot (libraries/AP_InertialSensor, AP_InertialSensor_Backend.cpp) does the same. Offsets are
in m/s^2 and rad/s. Files are those that QGroundControl and Mission Planner load.
"""

from __future__ import annotations

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.compensation import LinearModel
from sdimu_calibration.core.units import from_si
from sdimu_calibration.storage.export import shared
from sdimu_calibration.storage.export.shared import Source, by_force, comments, number

_REAL = 9
"""MAV_PARAM_TYPE_REAL32 of MAVLink: the type of every parameter here."""
_EQUATION = "along each axis force = (measured - offset) * scale, rate = measured - offset; offsets in m/s^2 and rad/s."
_AXES = "The axes of the result must be those of the sensor before the autopilot rotates it to the body."


def px4_texts(source: Source) -> dict[str, str]:
    """Return the text of the file that QGroundControl loads."""
    lines = comments(source, "#")
    lines += [
        f"# PX4: {_EQUATION}",
        f"# {_AXES}",
        "# CAL_ACC0_ID and CAL_GYRO0_ID must name this sensor: PX4 sets them when it calibrates, and keeps them.",
        "# Vehicle-Id Component-Id Name Value Type",
    ]
    lines += [f"1\t1\t{name}\t{number(value)}\t{_REAL}" for name, value in _named(source, "px4").items()]
    return {"": "\n".join(lines) + "\n"}


def ardupilot_texts(source: Source) -> dict[str, str]:
    """Return the text of the file that Mission Planner loads."""
    lines = comments(source, "#")
    lines += [
        f"# ArduPilot: {_EQUATION}",
        f"# {_AXES}",
        "# INS_GYR_CAL 0 keeps the offsets of the gyros: else they are measured anew at each start.",
    ]
    lines += [f"{name},{number(value)}" for name, value in _named(source, "ardupilot").items()]
    return {"": "\n".join(lines) + "\n"}


_NAMES = {
    "px4": ("CAL_ACC0_{}OFF", "CAL_ACC0_{}SCALE", "CAL_GYRO0_{}OFF"),
    "ardupilot": ("INS_ACCOFFS_{}", "INS_ACCSCAL_{}", "INS_GYROFFS_{}"),
}


def _named(source: Source, program: str) -> dict[str, float]:
    """Parameters by name: offsets and scales of the force, offsets of the rate."""
    linear = source.linear
    values = (linear.accel_bias, _scales(linear), linear.gyro_bias)
    return {
        name.format(axis): float(value)
        for name, row in zip(_NAMES[program], values, strict=True)
        for axis, value in zip("XYZ", row, strict=True)
    }


def _scales(linear: LinearModel) -> Floats:
    """Return what the force along each axis is multiplied by, shape (3,)."""
    return np.asarray(np.diag(np.linalg.inv(linear.accel)), dtype=np.float64)


def cannot_hold(linear: LinearModel) -> list[str]:
    """Say what is left out: everything between the axes, and the scale factors of the gyros."""
    lost = []
    ppm = from_si(float(np.abs(np.diag(linear.gyro) - 1.0).max()), "ppm")
    if ppm:
        lost.append(f"scale factors of the gyros, up to {ppm:.3g} ppm")
    for words, matrix in (("gyros", linear.gyro), ("accelerometers", linear.accel)):
        off = float(np.abs(matrix - np.diag(np.diag(matrix))).max())
        if off:
            lost.append(f"misalignment of the {words}, up to {from_si(off, 'arcmin'):.3g} arcmin")
    return lost + by_force(linear) + shared.cannot_hold(linear)
