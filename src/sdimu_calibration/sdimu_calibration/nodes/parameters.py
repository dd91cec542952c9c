"""Parameters that say what they mean: description, range, and read-only unless a node looks at them again.

A value outside its range, or of another type, is refused at `ros2 param set` and in a parameter file, by rclpy itself.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rclpy.exceptions import InvalidParameterTypeException, InvalidParameterValueException
from rclpy.node import Node

from sdimu_calibration.core.recording import DataError

_LARGE, _LARGEST = 2**62, 1e300


class Declare:
    """Declares parameters of a node and returns their values.

    Every method raises DataError, one line, when a value that was given is of another type or outside its range.
    """

    def __init__(self, node: Node) -> None:
        self._node = node

    def text(self, name: str, default: str, description: str, *, live: bool = False) -> str:
        """Declare a text."""
        return str(self._declare(name, default, ParameterDescriptor(description=description, read_only=not live)))

    def texts(self, name: str, default: Sequence[str], description: str, *, live: bool = False) -> list[str]:
        """Declare a list of texts; an empty text keeps the type of an empty list, and is left out."""
        described = ParameterDescriptor(description=description, read_only=not live)
        given = self._declare(name, list(default) or [""], described)
        return [str(text) for text in given if text]

    def flag(self, name: str, default: bool, description: str, *, live: bool = False) -> bool:
        """Declare a yes or no."""
        return bool(self._declare(name, default, ParameterDescriptor(description=description, read_only=not live)))

    def integer(self, name: str, default: int, description: str, *, least: int, most: int = _LARGE) -> int:
        """Declare a whole number between `least` and `most`."""
        span = IntegerRange(from_value=least, to_value=most, step=1)
        described = ParameterDescriptor(description=description, read_only=True, integer_range=[span])
        return int(self._declare(name, default, described))

    def number(
        self,
        name: str,
        default: float,
        description: str,
        *,
        least: float = -math.inf,
        most: float = math.inf,
        live: bool = False,
    ) -> float:
        """Declare a number between `least` and `most`."""
        span = FloatingPointRange(from_value=max(least, -_LARGEST), to_value=min(most, _LARGEST), step=0.0)
        described = ParameterDescriptor(description=description, read_only=not live, floating_point_range=[span])
        return float(self._declare(name, default, described))

    def _declare(self, name: str, default: object, descriptor: ParameterDescriptor) -> Any:
        try:
            return self._node.declare_parameter(name, default, descriptor).value
        except (InvalidParameterTypeException, InvalidParameterValueException) as error:
            raise DataError(f"parameter {name}: {error} ({descriptor.description})") from error
