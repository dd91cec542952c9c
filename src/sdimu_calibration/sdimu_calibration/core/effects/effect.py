"""What a sensor effect is: parameters, and the change of the sensors per unit of each.

An effect is linear in its parameters: the error of sensor axis c is the sum of ``regressor * parameter`` over its
terms on c. What enters nonlinearly (a time constant, an onset) is fixed in the effect and scanned by
making several of them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from sdimu_calibration.core.motion import Motion

Floats = NDArray[np.float64]

GYRO = (0, 1, 2)
"""Channels of gyro x, y, z."""
ACCEL = (3, 4, 5)
"""Channels of accelerometer x, y, z."""
CHANNELS = ("gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z")
AXES = "xyz"


@dataclass(frozen=True)
class Parameter:
    """A coefficient.

    Attributes
    ----------
    name : str
        The one name it has in config, state, result, report and truth.
    unit : str
        SI unit, as it stands in files.
    display_unit : str
        Customary unit, wherever a person reads.
    """

    name: str
    unit: str
    display_unit: str


@dataclass(frozen=True)
class Term:
    """One regressor column: which sensor axis (0-2 gyro, 3-5 accelerometer) and which parameter."""

    channel: int
    parameter: int


@dataclass(frozen=True)
class Effect:
    """A physical cause of sensor error.

    Attributes
    ----------
    name : str
        Registry name, e.g. ``gyro_scale``.
    title : str
        Standard term.
    equation : str
        Plain text, dw = measured minus true body rate, df likewise specific force.
    parameters : tuple of Parameter
    terms : tuple of Term
    regressors : callable
        ``Motion -> ndarray (n, len(terms))``, in the order of `terms`; SI per SI of the parameter.
    prior : mapping of str to float
        One-sigma size of each parameter by grade (``navigation``, ``tactical``, ``mems``), SI.
    description, typical : str
        What causes it and how it shows; usual sizes.
    confused_with : tuple of str
        Effects that look alike in a rate-table test.
    decay_s : float or None
        Correlation time of a first-order Gauss-Markov parameter; None for constants and random walks.
    random_walk : mapping of str to float
        Density of a random walk of the parameters by grade (SI/sqrt(s)); empty for constants.
    """

    name: str
    title: str
    equation: str
    parameters: tuple[Parameter, ...]
    terms: tuple[Term, ...]
    regressors: Callable[[Motion], Floats]
    prior: Mapping[str, float]
    description: str = ""
    typical: str = ""
    confused_with: tuple[str, ...] = ()
    decay_s: float | None = None
    random_walk: Mapping[str, float] = field(default_factory=dict)


def own_axis(triad: tuple[int, ...]) -> tuple[Term, ...]:
    """Terms of an effect with one parameter an axis, each acting on its own axis."""
    return tuple(Term(channel, i) for i, channel in enumerate(triad))


def per_axis(stem: str, unit: str, display_unit: str) -> tuple[Parameter, ...]:
    """Parameters ``stem_x``, ``stem_y``, ``stem_z``."""
    return tuple(Parameter(f"{stem}_{axis}", unit, display_unit) for axis in AXES)
