"""The rests of a run by hand with their residuals, as HTML text: what stops are for a table."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sdimu_calibration.core.results import Rest
from sdimu_calibration.core.units import from_si
from sdimu_calibration.report.markup import grid, quiet, section
from sdimu_calibration.report.table import as_far

_COLUMNS = (
    "rest",
    "from (s)",
    "to (s)",
    "force x y z (ug)",
    "in sigmas",
    "rate x y z (deg/h)",
    "in sigmas",
    "turn to it N E D (arcmin)",
    "in sigmas",
)


def rests_section(rests: Sequence[Rest]) -> str:
    """List the rests with what the fit leaves over at each."""
    rows = [_row(number, rest) for number, rest in enumerate(rests)]
    return section(
        "Rests and their residuals",
        grid(_COLUMNS, rows, set()),
        quiet(
            "Measured less predicted: the mean force and rate of each rest, and the turn from the rest before it (the "
            "heading of north is arbitrary). In sigmas: root mean square of the three axes over white noise and the "
            "scatter that was learned beyond it. A turn with a gap in it says nothing."
        ),
    )


def _row(number: int, rest: Rest) -> list[str]:
    out = [str(number), f"{rest.start_s:.1f}", f"{rest.end_s:.1f}"]
    for residual, sigma, unit in (
        (rest.force, rest.force_sigma, "ug"),
        (rest.rate, rest.rate_sigma, "deg/h"),
        (rest.turn, rest.turn_sigma, "arcmin"),
    ):
        seen = bool(np.isfinite(residual).all())
        shown = as_far([from_si(value, unit) for value in residual], from_si(sigma, unit)) if seen else []
        out.append("\N{EM SPACE}".join(shown))
        out.append(f"{np.sqrt(np.mean(np.square(residual))) / sigma:.2f}" if seen and sigma > 0.0 else "")
    return out
