"""A status of the rate table as a message object: reader of bags and live node take it alike."""

from __future__ import annotations

from typing import Any

from sdimu_calibration.core.recording import UNNUMBERED


def stamp_ns(message: Any) -> int:
    """header.stamp of a message (ns)."""
    return int(message.header.stamp.sec) * 1_000_000_000 + int(message.header.stamp.nanosec)


def phase_word(message: Any) -> str:
    """Phase in a diagnostic_msgs/DiagnosticArray, empty when there is none."""
    if not message.status:
        return ""
    values = {entry.key: entry.value for entry in message.status[0].values}
    return str(values.get("phase") or message.status[0].message).strip().lower()


def status_entry(message: Any) -> tuple[int, bool, int] | None:
    """Stamp (ns), True for dwell, stop (`UNNUMBERED` without one); None without a phase.

    A phase of any other name than ``dwell`` is no dwell.
    """
    phase = phase_word(message)
    if not phase:
        return None
    values = {entry.key: entry.value for entry in message.status[0].values}
    stop = values.get("stop", "").strip()
    return stamp_ns(message), phase == "dwell", int(stop) if stop.isdecimal() else UNNUMBERED
