"""An error that no effect of the catalogue explains, drawn against what it follows."""

from __future__ import annotations

from sdimu_calibration.core.diagnosis.diagnose import Diagnosis
from sdimu_calibration.core.posterior.unknown import UnknownFunction, unknown_functions
from sdimu_calibration.core.units import from_si
from sdimu_calibration.report.drawing import MUTED, Figure, lay_out
from sdimu_calibration.report.markup import Draw, quiet, section

_AXES = "xyz"
_NAMES = {"gyro": ("Gyros", "deg/h"), "accel": ("Accelerometers", "ug")}


def unknown_section(diagnosis: Diagnosis, draw: Draw) -> str:
    """Return the section; empty where nothing follows the attitude."""
    window = diagnosis.found.posterior
    found = () if window is None else unknown_functions(window, diagnosis.found.noise)
    if not found:
        return ""
    return section(
        "An error that follows the attitude",
        quiet(
            "No effect of the catalogue explains it. Error of each sensor at rest (95 % bands) against the share of "
            "gravity along each body axis: what bends here is a term of that force, what scatters hangs on another "
            "axis or on the way there."
        ),
        *(draw(followed(one)) for one in found),
    )


def followed(found: UnknownFunction) -> Figure:
    """Error of each axis of a triad against the force along each body axis, a panel each."""
    name, unit = _NAMES[found.triad]
    rest = ~found.turning
    figure = Figure(rows=3, cols=3, share_x=True, share_y=True, gap_x=0.03, gap_y=0.05)
    for row in range(3):
        value = from_si(1.0, unit) * found.mean[rest, row]
        band = 1.96 * from_si(1.0, unit) * found.sigma[rest, row]
        for col in range(3):
            figure.add(
                "scatter",
                x=found.force[rest, col],
                y=value,
                mode="markers",
                showlegend=False,
                error_y={"array": band, "color": MUTED, "thickness": 1, "width": 0},
                marker={"color": f"@{_AXES[row]}", "size": 6},
                hovertemplate=f"{found.triad} {_AXES[row]}: %{{y:.3g}} {unit}<extra></extra>",
                row=row + 1,
                col=col + 1,
            )
            if row == 2:
                figure.x_axes(title=f"force along {_AXES[col]} (g)", row=3, col=col + 1)
        figure.y_axes(title=f"{_AXES[row]} ({unit})", row=row + 1, col=1)
    return lay_out(figure, 620, title=name, margin={"l": 70, "r": 20, "t": 50, "b": 55})
