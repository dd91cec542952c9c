"""The architecture as one drawing: who hands what to whom."""

from __future__ import annotations

from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

_BOXES = {
    "table": (0.2, 3.0, 1.9, "rate_table_sim", "plan \N{RIGHTWARDS ARROW} motion"),
    "imu": (2.9, 3.0, 1.9, "sdimu_sim", "motion \N{RIGHTWARDS ARROW} samples\nwith errors"),
    "nodes": (5.6, 3.0, 1.9, "nodes", "live calibration,\nrecorder, replay"),
    "bag": (8.3, 3.0, 1.9, "bag", "samples, status,\nestimates (MCAP)"),
    "storage": (8.3, 1.55, 1.9, "storage", "bags, YAML,\nresult files"),
    "core": (2.9, 0.1, 4.6, "core", "reduce \N{RIGHTWARDS ARROW} navigate + filter \N{RIGHTWARDS ARROW} passes"
             " \N{RIGHTWARDS ARROW} diagnose\nonly mathematics: no ROS, files, plots, clocks"),
    "report": (5.6, 1.55, 1.9, "report", "report.html,\nworkbench"),
    "cli": (2.9, 1.55, 1.9, "cli", "sdimu calibrate,\ndiagnose, compare"),
}  # fmt: skip
"""Left, bottom, width, name, what it does; all are one high."""
_DATA = (
    ("table", "right", "imu", "left", "true motion"),
    ("imu", "right", "nodes", "left", "samples"),
    ("nodes", "right", "bag", "left", "recorder"),
    ("bag", "bottom", "storage", "top", ""),
)
_USES = (
    ("cli", "right", "report", "left", ""),
    ("report", "right", "storage", "left", ""),
    ("cli", "bottom", "core", "top", ""),
    ("report", "bottom", "core", "top", ""),
    ("storage", "bottom", "core", "right", ""),
)
"""Imports point to the core and never back; the nodes use storage and core as the verbs do."""
_HEIGHT = 0.95
_LEGEND = """solid: data; dashed: uses.
Table and IMU may be real:
the calibrator reads the same
topics and never the truth."""


def house() -> Figure:
    """Draw the rooms and what goes between them."""
    figure = Figure(figsize=(8.6, 3.4))
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set_xlim(0.0, 10.4)
    axes.set_ylim(0.0, 4.1)
    axes.set_axis_off()
    for name, (left, bottom, width, title, text) in _BOXES.items():
        heavy = name == "core"
        axes.add_patch(_box(left, bottom, width, heavy))
        middle = left + 0.5 * width
        axes.text(middle, bottom + 0.74, title, ha="center", va="center", weight="bold", fontsize=9)
        axes.text(middle, bottom + 0.32, text, ha="center", va="center", fontsize=7.5)
    for start, leaves, end, enters, word in (*_DATA, *_USES):
        a, b = _edge(start, leaves, end), _edge(end, enters, start)
        dash = "-" if (start, leaves, end, enters, word) in _DATA else "--"
        look = {"arrowstyle": "-|>", "color": "#222", "shrinkA": 1, "shrinkB": 1, "linestyle": dash}
        axes.annotate("", b, a, arrowprops=look)
        axes.text(0.5 * (a[0] + b[0]), a[1] + 0.12, word, ha="center", fontsize=6.5)
    axes.text(0.2, 0.75, _LEGEND, fontsize=7.5, va="center", style="italic")
    return figure


def _box(left: float, bottom: float, width: float, heavy: bool) -> Rectangle:
    return Rectangle(
        (left, bottom), width, _HEIGHT, facecolor="#eee" if heavy else "white", edgecolor="#222",
        lw=1.8 if heavy else 1.0,
    )  # fmt: skip


def _edge(name: str, side: str, towards: str) -> tuple[float, float]:
    """Middle of a side; on a wide box, the place nearest to the other."""
    left, bottom, width = _BOXES[name][:3]
    other = _BOXES[towards][0] + 0.5 * _BOXES[towards][2]
    if side in {"top", "bottom"}:
        return min(max(other, left + 0.2), left + width - 0.2), bottom + (_HEIGHT if side == "top" else 0.0)
    return left + (width if side == "right" else 0.0), bottom + 0.5 * _HEIGHT
