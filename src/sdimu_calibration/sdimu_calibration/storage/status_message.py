"""A status of the rate table, as both the reader of bags and the live node take it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from sdimu_calibration.core.recording import UNNUMBERED


def stamp_ns(message: Any) -> int:
    """header.stamp of a message (ns)."""
    return int(message.header.stamp.sec) * 1_000_000_000 + int(message.header.stamp.nanosec)


def first_entry(message: Any) -> tuple[str, dict[str, str]]:
    """Text and values of the first entry of a diagnostic_msgs/DiagnosticArray; empty where there is none."""
    if not message.status:
        return "", {}
    first = message.status[0]
    return first.message, {entry.key: entry.value for entry in first.values}


def phase_word(text: str, values: Mapping[str, str]) -> str:
    """Phase in the text and values of a status, empty when there is none."""
    return (values.get("phase") or text).strip().lower()


def phase_entry(ns: int, text: str, values: Mapping[str, str]) -> tuple[int, bool, int] | None:
    """Stamp (ns), True for dwell, stop (`UNNUMBERED` without one); None without a phase.

    A phase of any other name than ``dwell`` is no dwell.
    """
    phase = phase_word(text, values)
    if not phase:
        return None
    stop = values.get("stop", "").strip()
    return ns, phase == "dwell", int(stop) if stop.isdecimal() else UNNUMBERED
