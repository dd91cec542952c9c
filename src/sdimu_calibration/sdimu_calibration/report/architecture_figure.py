"""The architecture as one drawing: the way of the data, and who uses whom."""

from __future__ import annotations

from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

_TO = "\N{RIGHTWARDS ARROW}"
_BOXES = {
    "table": (0.2, 4.3, 1.9, "rate_table_sim", f"plan {_TO} motion"),
    "imu": (2.9, 4.3, 1.9, "sdimu_sim", f"motion {_TO} samples\nwith errors"),
    "nodes": (5.6, 4.3, 1.9, "nodes", "live calibration,\nrecorder, replay"),
    "bag": (8.3, 4.3, 1.9, "bag", "samples, status,\nestimates (MCAP)"),
    "cli": (0.2, 2.85, 1.9, "cli", "sdimu calibrate,\ndiagnose, compare"),
    "api": (2.9, 2.85, 1.9, "api", "the same from\nPython, notebooks"),
    "report": (5.6, 2.85, 1.9, "report", "report.html,\nworkbench"),
    "storage": (8.3, 2.85, 1.9, "storage", "bags, YAML,\nresult files"),
    "open": (0.4, 1.25, 2.3, "open", f"front_door: live and bag\n{_TO} PreparedTest"),
    "solve": (4.05, 1.25, 2.3, "solve", f"chooses the estimator\n{_TO} Fit"),
    "outcome": (7.7, 1.25, 2.3, "outcome", f"coefficients, covariance\n{_TO} Calibration"),
    "evidence": (4.05, 0.1, 2.3, "Fit.evidence", "residuals, signatures\nof the effects"),
    "climb": (7.7, 0.1, 2.3, "climb", f"which effect is missing\n{_TO} Diagnosis"),
}
"""Left, bottom, width, name, what it does; all are one high."""
_DATA = (
    ("table", "right", "imu", "left", "true motion"),
    ("imu", "right", "nodes", "left", "samples"),
    ("nodes", "right", "bag", "left", "recorder"),
    ("bag", "bottom", "storage", "top", ""),
    ("open", "right", "solve", "left", "test"),
    ("solve", "right", "outcome", "left", "fit"),
    ("solve", "bottom", "evidence", "top", ""),
    ("evidence", "right", "climb", "left", "evidence"),
    ("climb", "top", "solve", "bottom", "refit"),
)
_USES = tuple((user, "bottom", "core", "top", "") for user in ("cli", "api", "report", "storage"))
"""Imports point to the core and never back; the nodes use storage and core as the verbs do."""
_CORE = (0.2, 0.0, 10.0, 2.55)
"""Left, bottom, width, height of the core."""
_HEIGHT = 0.85
_LEGEND = """solid: data; dashed: uses.
Table and IMU may be real:
the calibrator reads the same
topics and never the truth."""


def architecture_figure() -> Figure:
    """Draw the rooms and what goes between them."""
    figure = Figure(figsize=(8.6, 4.4))
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set_xlim(0.0, 10.4)
    axes.set_ylim(-0.1, 5.25)
    axes.set_axis_off()
    axes.add_patch(Rectangle(_CORE[:2], *_CORE[2:], facecolor="#eee", edgecolor="#222", lw=1.8))
    axes.text(0.4, 2.32, "core", va="center", weight="bold", fontsize=9)
    axes.text(1.05, 2.32, "mathematics only: no ROS, files, plots, clocks", va="center", fontsize=7.5)
    for left, bottom, width, title, text in _BOXES.values():
        axes.add_patch(Rectangle((left, bottom), width, _HEIGHT, facecolor="white", edgecolor="#222"))
        middle = left + 0.5 * width
        axes.text(middle, bottom + 0.67, title, ha="center", va="center", weight="bold", fontsize=9)
        axes.text(middle, bottom + 0.29, text, ha="center", va="center", fontsize=7.5)
    for arrows, dash in ((_DATA, "-"), (_USES, "--")):
        for start, leaves, end, enters, word in arrows:
            a, b = _edge(start, leaves, end), _edge(end, enters, start)
            look = {"arrowstyle": "-|>", "color": "#222", "shrinkA": 1, "shrinkB": 1, "linestyle": dash}
            axes.annotate("", b, a, arrowprops=look)
            axes.text(0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1]) + 0.1, word, ha="center", fontsize=6.5)
    axes.text(0.4, 0.55, _LEGEND, fontsize=7.5, va="center", style="italic")
    return figure


def _edge(name: str, side: str, towards: str) -> tuple[float, float]:
    """Middle of a side, or the place on it that is nearest to the other box; arrows to the core are vertical."""
    left, bottom, width, height = _place(name)
    other_left, _, other_width, _ = _place(name if towards == "core" else towards)
    if side in {"top", "bottom"}:
        middle = other_left + 0.5 * other_width
        return min(max(middle, left + 0.2), left + width - 0.2), bottom + (height if side == "top" else 0.0)
    return left + (width if side == "right" else 0.0), bottom + 0.5 * height


def _place(name: str) -> tuple[float, float, float, float]:
    if name == "core":
        return _CORE
    left, bottom, width = _BOXES[name][:3]
    return left, bottom, width, _HEIGHT
