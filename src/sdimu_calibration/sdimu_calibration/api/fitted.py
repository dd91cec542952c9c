"""What every fit shows, of one recording or of a set: coefficients with units, as a table."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from difflib import get_close_matches
from html import escape
from typing import TYPE_CHECKING

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.error_figures import held_out, held_out_judged, nis, nis_judged, noise_learned
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.results import Calibration
from sdimu_calibration.core.units import from_si, parse_unit
from sdimu_calibration.extras import needed
from sdimu_calibration.report.table import as_text, cells, headings, rich_table, rows, with_sigma

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True)
class Coefficient:
    """A coefficient.

    Attributes
    ----------
    value, sigma : float
        SI.
    unit, display_unit : str
        SI unit, and the customary one.
    """

    name: str
    value: float
    sigma: float
    unit: str
    display_unit: str

    def to(self, unit: str) -> tuple[float, float]:
        """Value and sigma in another unit, such as ``deg/h``."""
        if parse_unit(unit).dimension != parse_unit(self.unit).dimension:
            raise DataError(f"{self.name}: '{unit}' is of another kind than '{self.display_unit}'")
        return from_si(self.value, unit), from_si(self.sigma, unit)

    def __repr__(self) -> str:
        """Name, value and sigma in the customary unit."""
        value, sigma = self.to(self.display_unit)
        return f"{self.name} = {with_sigma(value, sigma, self.display_unit)}"


_WIDTH = 110
"""Columns of the table that stands for a fit."""


class Fitted:
    """Coefficients with units, indexed by their names; its ``repr`` is their table, in a notebook as HTML."""

    @property
    def result(self) -> Calibration:
        """Coefficients, covariance, fit figures and notes."""
        raise NotImplementedError

    @property
    def _heading(self) -> str:
        raise NotImplementedError

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the coefficients, length p."""
        return self.result.names

    @property
    def values(self) -> Floats:
        """Coefficients (SI) in the reported body frame, shape (p,)."""
        return self.result.values

    @property
    def covariance(self) -> Floats:
        """Covariance of `values`, shape (p, p)."""
        return self.result.covariance

    def __getitem__(self, name: str) -> Coefficient:
        """Give a coefficient by its name."""
        if name not in self.names:
            near = get_close_matches(name, self.names, n=3)
            hint = f"did you mean {', '.join(near)}?" if near else f"it has {', '.join(self.names[:6])}, ..."
            raise KeyError(f"no coefficient '{name}' in this model; {hint}")
        k, result = self.names.index(name), self.result
        sigma = float(np.sqrt(self.covariance[k, k]))
        return Coefficient(name, float(self.values[k]), sigma, result.units[k], result.display_units[k])

    def __iter__(self) -> Iterator[Coefficient]:
        """Go through the coefficients in the order of `values`."""
        return (self[name] for name in self.names)

    def __len__(self) -> int:
        """Return the number of coefficients."""
        return len(self.names)

    def __repr__(self) -> str:
        """Table of coefficients with units, and how well the fit predicts."""
        return as_text(rich_table(rows(self.result), self._heading), _WIDTH) + self._figures()

    def _repr_html_(self) -> str:
        """Table of coefficients as HTML."""
        entries = rows(self.result)
        columns = headings(entries)
        head = "".join(f"<th>{escape(c)}</th>" for c in columns)
        body = "".join(
            "<tr>" + "".join(f"<td>{escape(text)}</td>" for text in cells(row, columns)) + "</tr>" for row in entries
        )
        table = f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"
        return f"<p>{escape(self._heading)}</p>{table}" + (f"<p>{escape(self._figures())}</p>")

    def _figures(self) -> str:
        right = _errors(nis_judged(self.result), held_out_judged(self.result))
        if noise_learned(self.result):
            white = _errors(nis(self.result), held_out(self.result))
            right = f"{right} in the noise that was learned (1 is right; in white noise {white})"
        else:
            right = f"{right} (1 is right)"
        return "; ".join([right, *self.result.inseparable])

    def to_dataframe(self) -> pd.DataFrame:
        """Coefficients as a table: name, value, sigma, unit (customary)."""
        numbers = [(c.name, *c.to(c.display_unit), c.display_unit) for c in self]
        # Optional, and slow to load.
        made: pd.DataFrame = needed("pandas").DataFrame(numbers, columns=["name", "value", "sigma", "unit"])
        return made.set_index("name")


def _errors(squared: float, error: float) -> str:
    """Name NIS and held-out error; the latter where it was computed."""
    return f"NIS {squared:.3f}" + ("" if math.isnan(error) else f", held-out error {error:.3f}")
