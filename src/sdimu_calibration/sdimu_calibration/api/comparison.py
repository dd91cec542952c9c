"""Models of one recording side by side, as scripts and notebooks see them."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

from rich.table import Table

from sdimu_calibration.api.fit import CalibrationFit
from sdimu_calibration.report.comparison import comparison, headings, remarks, simplest_first
from sdimu_calibration.report.table import as_text

_WIDTH = 140
"""Columns of the table."""


class Comparison:
    """A ladder of models.

    Attributes
    ----------
    rows : list of list of str
        One a model, in the order of `headings`; the model with the fewest coefficients first.
    headings : tuple of str
        Model, noise learned (where any was), log-likelihood, difference to the one before, NIS, held-out error,
        coefficients that moved.
    remarks : tuple of str
        What the columns mean, and where they do not compare.
    """

    def __init__(self, fits: Sequence[CalibrationFit]) -> None:
        order = simplest_first([fit.result for fit in fits])
        results = [fits[k].result for k in order]
        self.rows = comparison([f"model {k + 1}" for k in order], results)
        self.headings, self.remarks = headings(results), remarks(results, order)

    def __repr__(self) -> str:
        """Table of the models."""
        table = Table(*self.headings)
        for row in self.rows:
            table.add_row(*row)
        return "\n".join([as_text(table, _WIDTH).rstrip("\n"), *self.remarks])

    def _repr_html_(self) -> str:
        """Table of the models as HTML."""
        lines = "".join("<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>" for row in self.rows)
        head = "".join(f"<th>{escape(text)}</th>" for text in self.headings)
        return f"<table><tr>{head}</tr>{lines}</table>" + "".join(f"<p>{escape(remark)}</p>" for remark in self.remarks)
