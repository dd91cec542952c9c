"""How a user states something or does something: the core names it, a shell says how (`speak`).

A message holds members of `Option` and `Work`; what they read like is the shell's to say, once for a process.
"""

from __future__ import annotations

from collections.abc import Callable
from enum import Enum

Speaker = Callable[[str], str]
"""Makes of a name what a user types."""


def _plain(name: str) -> str:
    return name


_said: dict[str, Speaker] = {"option": _plain, "work": _plain}


def speak(option: Speaker, work: Speaker) -> None:
    """Let a shell say how its users state an option and start a work.

    `option`, `work`: make words of the value of an `Option` and of a `Work`.
    """
    _said.update(option=option, work=work)


class Option(Enum):
    """What a user may state, by the name of the parameter."""

    ACCEL_SIGN = "accel_sign"
    ACCEL_UNIT = "accel_unit"
    ADD = "add"
    EFFECT = "effect"
    ESTIMATOR = "estimator"
    EXCLUDE_TIMES = "exclude_times"
    GYRO_SIGN = "gyro_sign"
    GYRO_UNIT = "gyro_unit"
    IMU = "imu"
    NOISE = "noise"
    POWER_ON = "power_on"
    RESTS = "rests"
    SAME_START = "same_start"
    SERIAL = "serial"
    SITE = "site"
    TABLE = "table"
    WHOLE_TURNS = "whole_turns"

    def __str__(self) -> str:
        """Name of the option as the shell says it."""
        return _said["option"](self.value)


class Work(Enum):
    """What a user may start."""

    CALIBRATE = "calibrate"
    CUT = "cut"
    DIAGNOSE = "diagnose"
    EFFECTS = "effects"
    FLEET = "fleet"
    IMPORT = "import"
    NOISE = "noise"

    def __str__(self) -> str:
        """Name of the work as the shell says it."""
        return _said["work"](self.value)
