"""Models of one recording side by side, as scripts and notebooks see them."""

from __future__ import annotations

import io
from collections.abc import Sequence
from html import escape

from rich.console import Console
from rich.table import Table

from sdimu_calibration.api.fit import CalibrationFit
from sdimu_calibration.report.comparison import HEADINGS, OTHER_SCALE, comparison, other_scale

_WIDTH = 140
"""Columns of the table."""


class Comparison:
    """A ladder of models.

    Attributes
    ----------
    rows : list of list of str
        One a model: model, log-likelihood, difference to the one before, NIS, held-out error, coefficients that moved.
    """

    def __init__(self, fits: Sequence[CalibrationFit]) -> None:
        results = [fit.result for fit in fits]
        self.rows = comparison([f"model {k}" for k in range(1, len(fits) + 1)], results)
        self._note = OTHER_SCALE if other_scale(results) else ""

    def __repr__(self) -> str:
        """Table of the models."""
        table = Table(*HEADINGS)
        for row in self.rows:
            table.add_row(*row)
        text = io.StringIO()
        Console(file=text, width=_WIDTH, color_system=None).print(table)
        return text.getvalue() + self._note

    def _repr_html_(self) -> str:
        """Table of the models as HTML."""
        lines = "".join("<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>" for row in self.rows)
        head = "".join(f"<th>{escape(text)}</th>" for text in HEADINGS)
        return f"<table><tr>{head}</tr>{lines}</table><p>{escape(self._note)}</p>"
