"""A status of the rate table, as both the reader of bags and the live node take it."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from sdimu_calibration.core.recording import UNNUMBERED

PHASES = ("dwell", "rotating")
"""All that a table says of itself; any other word says nothing."""
_STOP = re.compile(r"[0-9]{1,9}")
"""Number of a stop: digits that every program reads alike, and no more than fit into an integer."""


def stamp_ns(message: Any) -> int:
    """header.stamp of a message (ns)."""
    return int(message.header.stamp.sec) * 1_000_000_000 + int(message.header.stamp.nanosec)


def first_entry(message: Any) -> tuple[str, dict[str, str]]:
    """Text and values of the first entry of a diagnostic_msgs/DiagnosticArray; empty where there is none."""
    if not message.status:
        return "", {}
    first = message.status[0]
    return first.message, {entry.key: entry.value for entry in first.values}


def phase_of(text: str, values: Mapping[str, str]) -> str | None:
    """Phase in the text and values of a status; None where they say neither ``dwell`` nor ``rotating``."""
    word = (values.get("phase") or text).strip().lower()
    return word if word in PHASES else None


def phase_entry(ns: int, text: str, values: Mapping[str, str]) -> tuple[int, bool, int] | None:
    """Stamp (ns), True for dwell, stop (`UNNUMBERED` without one); None without a phase.

    A word that is no phase says nothing: what was said before holds on, until it is too old (`phases.STALE_S`).
    """
    phase = phase_of(text, values)
    if phase is None:
        return None
    stop = values.get("stop", "").strip()
    return ns, phase == "dwell", int(stop) if _STOP.fullmatch(stop) else UNNUMBERED
