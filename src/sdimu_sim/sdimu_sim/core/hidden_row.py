"""Row of the table of hidden effects: a family of names, and what each adds to which sensor."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

_XYZ = "xyz"


@dataclass(frozen=True)
class Row:
    """Family of effects."""

    names: str
    """Coefficients, ``gyro_...`` or ``accel_...``, with index letters."""
    unit: str
    """Of the size k."""
    formula: str | Mapping[str, str]
    """rad/s or m/s^2, in `sdimu_sim.core.hidden.VARIABLES`, k and the options (SI); by sensor where it is not that of
    the name alone."""
    options: Mapping[str, str] = field(default_factory=dict)
    """Unit of each option."""
    drawn: bool = True
    """The campaign on hidden effects draws it; what came later is left out, so that a seed draws what it drew before.
    """
    memory: tuple[str, ...] = ()
    """What `y` is in the formula: kind of `sdimu_sim.core.memory`, variable that is remembered, option that it has."""


class Part(NamedTuple):
    """What a name adds to one sensor: formula and memory (`Row`) filled in."""

    sensor: str
    formula: str
    memory: tuple[str, ...]


class Entry(NamedTuple):
    """A name of a family: its row, and what it adds to sensors."""

    row: Row
    parts: tuple[Part, ...]


def expand(row: Row) -> Iterable[tuple[str, Entry]]:
    """Every name of a family, with its sensors and its formulas filled in."""
    triad = row.names.split("_", 1)[0]
    for i in _XYZ:
        o, p = (a for a in _XYZ if a != i)
        # Quadrature of the mass unbalance (doc/conventions.md): x with y, y with x, z with y.
        quadrature = "x" if i == "y" else "y"
        # The circle x, y, z: n and m come after i.
        n, m = ((o, p), (p, o))[i == "y"]
        for j, whichever, pair in itertools.product(o + p, _XYZ, ("xy", "xz", "yz")):
            letters = {"i": i, "j": j, "o": o, "p": p, "any": whichever, "pair": pair, "d": i, "q": quadrature}
            letters |= {"n": n, "m": m}
            formulas = {f"{triad}_{i}": row.formula} if isinstance(row.formula, str) else row.formula
            memory = tuple(word.format(**letters) for word in row.memory)
            yield (
                row.names.format(**letters),
                Entry(
                    row,
                    tuple(
                        Part(sensor.format(**letters), formula.format(**letters), memory)
                        for sensor, formula in formulas.items()
                    ),
                ),
            )
