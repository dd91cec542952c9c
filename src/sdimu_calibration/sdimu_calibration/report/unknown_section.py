"""An error that no effect of the catalogue explains, drawn against what it follows."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sdimu_calibration.core.diagnosis.diagnose import Diagnosis
from sdimu_calibration.core.noise_term import ATTITUDE, RATE, TEMPERATURE
from sdimu_calibration.core.posterior.unknown import UnknownFunction, unknown_functions
from sdimu_calibration.core.units import from_si
from sdimu_calibration.report.drawing import MUTED, Figure, lay_out
from sdimu_calibration.report.markup import Draw, quiet, section

_AXES = "xyz"
_UNITS = {"gyro": "deg/h", "accel": "ug"}
_FOLLOWED = {
    ATTITUDE: (
        "force along {} (g)",
        1.0,
        "at rest (filled) and in turns (open), against the share of gravity along each body axis",
    ),
    RATE: ("rate about {} (deg/s)", float(np.degrees(1.0)), "in turns, against the rate about each body axis"),
    TEMPERATURE: ("temperature over T0 (K)", 1.0, "at rest, against the temperature"),
}
"""Title of an axis, its unit in SI, and what is drawn, by what the error follows."""


def unknown_section(found: Sequence[UnknownFunction], draw: Draw) -> str:
    """Return the section; empty where nothing unknown follows attitude, rate or temperature."""
    if not found:
        return ""
    drawn = "; ".join(dict.fromkeys(_FOLLOWED[one.follows][2] for one in found))
    return section(
        f"An error that follows the {' and the '.join(dict.fromkeys(one.follows for one in found))}",
        quiet(
            f"No effect of the catalogue explains it. Error of each sensor with 95 % bands, {drawn}, without what "
            "the coefficients take up: what bends here is a term of that axis, what scatters hangs on another axis or "
            "on the way there."
        ),
        *(draw(followed(one)) for one in found),
    )


def unknown_of(diagnosis: Diagnosis) -> tuple[UnknownFunction, ...]:
    """Errors that no effect explains and that follow something, in the noise that is told."""
    window = diagnosis.found.posterior
    return () if window is None else unknown_functions(window, diagnosis.found.noise)


def followed(found: UnknownFunction) -> Figure:
    """Error of each sensor that has it against each component of what it follows, a panel each."""
    unit = _UNITS[found.triad]
    title, factor, _ = _FOLLOWED[found.follows]
    at = {RATE: found.turning, TEMPERATURE: ~found.turning}.get(found.follows, np.ones(len(found.turning), dtype=bool))
    symbols = np.where(found.turning[at] & (found.follows == ATTITUDE), "circle-open", "circle").tolist()
    columns = found.variable.shape[1]
    figure = Figure(rows=len(found.axes), cols=columns, share_x=True, share_y=True, gap_x=0.03, gap_y=0.05)
    for row, axis in enumerate(found.axes):
        value = from_si(1.0, unit) * found.mean[at, axis]
        band = 1.96 * from_si(1.0, unit) * found.sigma[at, axis]
        for col in range(columns):
            figure.add(
                "scatter",
                x=factor * found.variable[at, col],
                y=value,
                mode="markers",
                showlegend=False,
                error_y={"array": band, "color": MUTED, "thickness": 1, "width": 0},
                marker={"color": f"@{_AXES[axis]}", "size": 6, "symbol": symbols},
                hovertemplate=f"{found.triad} {_AXES[axis]}: %{{y:.3g}} {unit}<extra></extra>",
                row=row + 1,
                col=col + 1,
            )
            if axis == found.axes[-1]:
                figure.x_axes(title=title.format(_AXES[col]), row=row + 1, col=col + 1)
        figure.y_axes(title=f"{found.triad} {_AXES[axis]} ({unit})", row=row + 1, col=1)
    return lay_out(figure, 125 + 155 * len(found.axes), margin={"l": 80, "r": 20, "t": 20, "b": 55})
