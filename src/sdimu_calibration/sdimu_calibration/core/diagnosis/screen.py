"""Faults in the data that are no physics: looked at first, because they pass for effects otherwise."""

from __future__ import annotations

from dataclasses import dataclass

from sdimu_calibration.core.estimation.fit import Fit


@dataclass(frozen=True)
class Finding:
    """A fault of the data."""

    text: str
    """What it is."""
    grave: bool
    """Results cannot be trusted unless it is mended."""
    kind: str = ""
    """As in `DataFault`; empty for what is no fault of samples."""
    start_s: float = float("nan")
    end_s: float = float("nan")
    """`start_s`, `end_s`: time of the first and the last sample (s)."""


def screen(fit: Fit) -> tuple[Finding, ...]:
    """Say what is wrong with the data."""
    out = [Finding(fault.text, fault.grave, fault.kind, fault.start_s, fault.end_s) for fault in fit.faults]
    rejected = fit.test.recording.rejected
    if rejected:
        out.append(Finding(f"{rejected} samples were rejected (not finite or repeated stamps)", False))
    return tuple(out)
