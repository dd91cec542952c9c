"""The study of sets in a table: what was found of what was hidden, and how the errors compare with their sigmas."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from sdimu_calibration.core.verdict import Verdict

Rows = Sequence[Mapping[str, Any]]


def headings() -> tuple[str, ...]:
    """Name the columns of `line`."""
    return ("sets of", "runs", "right", "what is right", "false", "RMS z", "largest z")


def line(kind: str, rows: Rows) -> tuple[str, ...]:
    """Sum the runs of one kind up.

    Parameters
    ----------
    kind : str
        One of `set_run.KINDS`.
    rows : sequence of mapping
        Of `SetRun`, or with ``error``.
    """
    good = [row for row in rows if "error" not in row]
    right, of, what = {"weak": _named, "clean": _clean, "class": _alone, "turn-on": _covered}[kind](good)
    false = sum(bool(row.get("labels")) and not row["named"] for row in good if "labels" in row)
    z2, count = sum(row["z2"] for row in good), sum(row["count"] for row in good)
    return (
        kind, f"{len(good)} of {len(rows)}", f"{right} of {of}", what, str(false) if kind != "turn-on" else "",
        f"{np.sqrt(z2 / max(1, count)):.2f}", f"{max((row['largest_z'] for row in good), default=0.0):.1f}",
    )  # fmt: skip


def _named(rows: Rows) -> tuple[int, int, str]:
    single = sum(row["in_one"] for row in rows)
    return sum(row["named"] for row in rows), len(rows), f"named in the set (in one recording: {single})"


def _clean(rows: Rows) -> tuple[int, int, str]:
    return sum(row["verdict"] == Verdict.CONSISTENT for row in rows), len(rows), "consistent"


def _alone(rows: Rows) -> tuple[int, int, str]:
    asked = [row for row in rows if len(row["open"]) > 1]
    return sum(row["alone"] for row in asked), len(asked), f"the right one alone ({len(rows)} drawn, these open in one)"


def _covered(rows: Rows) -> tuple[int, int, str]:
    pairs = [s for row in rows for s in row["scatter"]]
    return sum(s["low"] <= s["true"] <= s["high"] for s in pairs), len(pairs), "true scatter inside its interval"
