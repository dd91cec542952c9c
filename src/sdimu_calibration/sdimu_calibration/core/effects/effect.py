"""What a sensor effect is: parameters, and the change of the sensors per unit of each.

An effect is linear in its parameters: the error of sensor axis c is the sum of ``regressor * parameter`` over its
terms on c. What enters nonlinearly (a time constant, an onset) is fixed in the effect and scanned by
making several of them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import Enum
from functools import cached_property
from typing import Any, Literal

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.effect_key import SENSORS, variant
from sdimu_calibration.core.effects.motion import Motion
from sdimu_calibration.core.units import to_si

GYRO = (0, 1, 2)
"""Channels of gyro x, y, z."""
ACCEL = (3, 4, 5)
"""Channels of accelerometer x, y, z."""
CHANNELS = SENSORS
AXES = "xyz"
BASELINE = "The baseline"
"""Group of the seven effects of Kim, Song & Lyou."""
REFERENCES = "References and geometry"
"""Group of errors of the test, not of the sensors."""
OF_ONE_TIME = frozenset({"t0", "span", "turn"})
"""Options of effects that happen at one time of one recording."""
Scope = Literal["unit", "power-on", "setup", "recording"]


class Excitation(Enum):
    """What a test must do to show an effect, or to tell it from its lookalikes."""

    BOTH_SENSES = "turns in both senses"
    """Even in the rate: one sense of turn leaves the effect to scale factor and misalignment."""
    TWO_RATES = "turns at two rates"
    """Functions of the rate that one rate cannot tell apart."""
    TWO_AXES = "turns about two axes at once"
    """Products of rates about different axes."""
    OBLIQUE_STOPS = "stops between the body axes"
    """Products and powers of forces."""
    REPEATED_ATTITUDES = "the same attitude early and late"
    """Functions of time."""


@dataclass(frozen=True)
class Parameter:
    """A coefficient."""

    name: str
    """The one name it has in config, state, result, report and truth."""
    unit: str
    """SI unit, as it stands in files."""
    display_unit: str
    """Customary unit, wherever a person reads."""


@dataclass(frozen=True)
class Term:
    """Where one regressor column acts."""

    channel: int
    """Sensor axis that it changes: 0-2 gyro x, y, z; 3-5 accelerometer x, y, z."""
    parameter: int
    """Index of the parameter, in its effect, that it is multiplied with."""


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
    regressors : callable
        ``Motion -> ndarray (n, len(terms))``, in the order of `terms`; SI per SI of the parameter.
    prior : mapping of str to float
        One-sigma size of each parameter by grade (``navigation``, ``tactical``, ``mems``), SI.
    description, typical : str
        What causes it and how it shows; usual sizes.
    confused_with : tuple of str
        Effects that look alike in a rate-table test.
    group : str
        Heading on pages; empty: the triad that the effect acts on.
    scope : str
        What a value holds for: ``unit`` (the instrument until it is calibrated again), ``power-on`` (from switch-on to
        switch-off: biases and their drifts), ``setup`` (site and mount of the test, no sensor error) or ``recording``
        (a fault of the data of one recording).
    excitation : frozenset of Excitation
        Motion without which a test does not show the effect.
    bias_drift : bool
        A change of a bias in time by itself: several in a row follow any drift and say nothing of its cause.
    shifts_bias : bool
        With it in the model, a bias is the one where its regressor is zero (for temperature: at the start), and no
        longer the mean over the test.
    wander_like : bool
        A transient after each turn, or a bias that the turns add up to: noise that makes a bias wander imitates it, so
        in such noise it must show more clearly, as a drift must.
    positive : bool
        Its parameters cannot be negative: data may be lost in a turn, never gained.
    needs_table : bool
        Has no meaning handheld: no reference but gravity is known, and no turn is known better than the gyros tell it.
    gauge : bool
        Part of the turn of the body frame that no measurement shows: only its prior holds it.
    linear : bool
        Its regressors are constants and multiples of rate and force: the slope of its errors is the same everywhere.
    never_seen : str
        Why no plan tells it from the model's coefficients, and what to do instead; empty when a plan can.
    decay_s : float or None
        Correlation time of a first-order Gauss-Markov parameter; None for constants and random walks.
    random_walk : mapping of str to float
        Density of a random walk of the parameters by grade (SI/sqrt(s)); empty for constants.
    tried_in : str
        Where a diagnosis looks for it unasked: in every ``recording``, or only in a ``set`` of recordings that are
        diagnosed together; ``request``: nowhere. Every effect that is tried raises the threshold of all others.
    family : str
        Registry name of the effect of which this is a part; empty for whole effects.
    contained_in : str
        Registry name of a larger effect that has these terms among its own: an IMU file that states a prior of it, and
        none of this one, states it of these terms; empty: none.
    parts : mapping of str to str
        Of parameters that a smaller effect has by another name: its registry name. An IMU file that states a prior of
        that one, and none of this, states it of these parameters.
    needs : str
        ``temperature``, ``magnetic`` or empty: what must be recorded or known for the effect to mean anything.
    options : mapping of str to str
        Fixed quantities that enter nonlinearly, such as ``{"tau": "1200 s"}``.
    with_options : callable or None
        ``(**options in SI) -> Effect``: the effect with these options.
    scan : callable or None
        ``Timetable -> tuple of Effect``: the variants that are worth trying on a test.
    nearer : callable or None
        ``() -> tuple of Effect``: the next variants of an interval search, half as far apart as those before. The
        variant itself is in the middle.
    sheet : str
        Term of a data sheet, without the triad, under which its coefficients are quoted; empty: none.
    file : str
        Path of the effect file that it was read from; empty for all others.
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
    group: str = ""
    scope: Scope = "unit"
    excitation: frozenset[Excitation] = frozenset()
    bias_drift: bool = False
    shifts_bias: bool = False
    wander_like: bool = False
    positive: bool = False
    needs_table: bool = False
    gauge: bool = False
    linear: bool = False
    never_seen: str = ""
    needs: str = ""
    tried_in: Literal["recording", "set", "request"] = "recording"
    family: str = ""
    contained_in: str = ""
    parts: Mapping[str, str] = field(default_factory=dict)
    options: Mapping[str, str] = field(default_factory=dict)
    with_options: Callable[..., Effect] | None = None
    scan: Callable[[Timetable], tuple[Effect, ...]] | None = None
    nearer: Callable[[], tuple[Effect, ...]] | None = None
    sheet: str = ""
    file: str = ""

    def only(self, names: tuple[str, ...]) -> Effect:
        """Return the effect with the named parameters alone."""
        kept = [i for i, p in enumerate(self.parameters) if p.name in names]
        if self.family and len(kept) == len(self.parameters):
            return self
        columns = [c for c, term in enumerate(self.terms) if term.parameter in kept]
        whole = self.regressors
        label = self.name if len(kept) == len(self.parameters) else "+".join(names) + self.variant
        return replace(
            self,
            name=label,
            family=self.family or self.name,
            parameters=tuple(self.parameters[i] for i in kept),
            terms=tuple(Term(self.terms[c].channel, kept.index(self.terms[c].parameter)) for c in columns),
            regressors=whole.only(columns) if isinstance(whole, _Columns) else lambda motion: whole(motion)[:, columns],
        )

    @cached_property
    def singles(self) -> tuple[Effect, ...]:
        """Each parameter as an effect of its own."""
        return tuple(self.only((p.name,)) for p in self.parameters)

    @property
    def sheet_term(self) -> str:
        """Term of a data sheet with its triad, such as ``gyro scale-factor error``; empty: none."""
        triad = "gyro" if self.terms[0].channel in GYRO else "accelerometer"
        return f"{triad} {self.sheet}" if self.sheet else ""

    @property
    def key(self) -> str:
        """Canonical key (`core.effect_key`): the name with its variant; `selection.resolve` reads it back."""
        return self._key(self.name)

    @property
    def labels(self) -> tuple[str, ...]:
        """Canonical key of each parameter: what tells it from that of another variant."""
        return tuple(self._key(p.name) for p in self.parameters)

    @property
    def variant(self) -> str:
        """What stands behind the name in brackets, e.g. ``(tau=1200 s)``; empty without options."""
        return variant(self.options)

    def _key(self, name: str) -> str:
        return name if name.endswith(self.variant) else name + self.variant


@dataclass(frozen=True)
class Timetable:
    """When a recording stands and turns."""

    duration: float
    """Seconds."""
    stops: tuple[tuple[int, float, float], ...]
    turns: tuple[tuple[int, float, float], ...]
    """`stops`, `turns`: index of the stop (of the stop before the turn), start and end (s)."""


Column = Callable[[Motion], Floats]


@dataclass(frozen=True)
class _Columns:
    """Regressors (n, m) that are made column by column, so that a few of them cost a few."""

    functions: tuple[Column, ...]

    def __call__(self, motion: Motion) -> Floats:
        return np.column_stack([f(motion) for f in self.functions])

    def only(self, columns: Sequence[int]) -> _Columns:
        return _Columns(tuple(self.functions[c] for c in columns))


def family(
    stem: str,
    title: str,
    equation: str,
    columns: Mapping[str, tuple[int, Column]],
    units: tuple[str, str],
    prior: tuple[float, float, float],
    **more: Any,
) -> Effect:
    """Effect with one regressor column a parameter.

    Parameters
    ----------
    stem : str
        Registry name; parameters are ``stem_suffix``.
    columns : mapping of suffix to (channel, Motion -> ndarray (n,))
    units : tuple of str
        SI and display unit of the parameters.
    prior : tuple of float
        One-sigma for navigation, tactical and mems grade in the display unit.
    more
        Other attributes of `Effect`.
    """
    si, display = units
    factor = to_si(1.0, display)
    return Effect(
        name=stem,
        title=title,
        equation=equation,
        parameters=tuple(Parameter(f"{stem}_{suffix}", si, display) for suffix in columns),
        terms=tuple(Term(channel, i) for i, (channel, _) in enumerate(columns.values())),
        regressors=_Columns(tuple(column for _, column in columns.values())),
        prior=dict(zip(("navigation", "tactical", "mems"), (factor * v for v in prior), strict=True)),
        **more,
    )


def pick(of: Callable[[Motion], Floats], *place: int) -> Column:
    """Make a column function that takes one component of a variable of the motion.

    Parameters
    ----------
    of : callable
        ``Motion -> ndarray, shape (n, ...)``, in the unit that the regressor has.
    *place : int
        Index of the component behind the first axis: ``i`` of a vector, ``i, j`` of a matrix.

    Returns
    -------
    callable
        ``Motion -> ndarray, shape (n,)``, in the same unit.
    """
    index: Any = (slice(None), *place)

    def column(motion: Motion) -> Floats:
        return np.asarray(of(motion)[index])

    return column


def product(of: Callable[[Motion], Floats], i: int, other: Callable[[Motion], Floats], j: int) -> Column:
    """Make a column function that multiplies two components of the motion.

    Parameters
    ----------
    of, other : callable
        ``Motion -> ndarray, shape (n, 3)``; their units multiply.
    i, j : int
        Column of the first and of the second.

    Returns
    -------
    callable
        ``Motion -> ndarray, shape (n,)``.
    """

    def column(motion: Motion) -> Floats:
        return np.asarray(of(motion)[:, i] * other(motion)[:, j])

    return column


def per_axis_columns(triad: tuple[int, ...], of: Callable[[Motion], Floats]) -> dict[str, tuple[int, Column]]:
    """Columns x, y, z of `family`: each sensor of a triad sees the component along its own axis.

    Parameters
    ----------
    triad : tuple of int
        `GYRO` or `ACCEL`.
    of : callable
        ``Motion -> ndarray, shape (n, 3)``, in the unit that the regressor has.
    """
    return {axis: (triad[i], pick(of, i)) for i, axis in enumerate(AXES)}


def matrix_columns(
    triad: tuple[int, ...], of: Callable[[Motion], Floats], diagonal: bool = True
) -> dict[str, tuple[int, Column]]:
    """Columns xx, xy ... zz of `family`: in column ij sensor i sees the component along axis j.

    Parameters
    ----------
    triad : tuple of int
        `GYRO` or `ACCEL`.
    of : callable
        ``Motion -> ndarray, shape (n, 3)``, in the unit that the regressor has.
    diagonal : bool
        Whether xx, yy and zz are among them.
    """
    return {AXES[i] + AXES[j]: (triad[i], pick(of, j)) for i in range(3) for j in range(3) if diagonal or i != j}


def own_axis(triad: tuple[int, ...]) -> tuple[Term, ...]:
    """Terms of an effect with one parameter an axis, each acting on its own axis."""
    return tuple(Term(channel, i) for i, channel in enumerate(triad))


def per_axis(stem: str, unit: str, display_unit: str) -> tuple[Parameter, ...]:
    """Parameters ``stem_x``, ``stem_y``, ``stem_z``."""
    return tuple(Parameter(f"{stem}_{axis}", unit, display_unit) for axis in AXES)
