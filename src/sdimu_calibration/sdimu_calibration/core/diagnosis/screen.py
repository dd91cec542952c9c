"""Faults in the data that are no physics: looked at first, because they pass for effects otherwise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sdimu_calibration.core.alignment.prepared import PreparedData
from sdimu_calibration.core.filter.passes import Solution
from sdimu_calibration.core.recording import Recording

_MISLEADING = frozenset({"stuck", "saturated"})
"""Faults of a sensor that its other samples may share to a lesser degree, so that an effect can pass for them."""
_OUTSIDE = 4.5
"""Thirty coefficients of a sensor within its specification pass this once in 5000 tests."""


@dataclass(frozen=True)
class Finding:
    """A fault of the data.

    Attributes
    ----------
    text : str
        What it is.
    grave : bool
        Results cannot be trusted unless it is mended.
    kind : str
        As in `DataFault`; empty for what is no fault of samples.
    start_s, end_s : float
        Time of the first and the last sample (s).
    """

    text: str
    grave: bool
    kind: str = ""
    start_s: float = float("nan")
    end_s: float = float("nan")


def screen(recording: Recording, prepared: PreparedData) -> tuple[Finding, ...]:
    """Say what the reduction found wrong with the data: gaps, stuck sensors, saturation, contradictions."""
    out = [
        Finding(fault.text, fault.grave or fault.kind in _MISLEADING, fault.kind, fault.start_s, fault.end_s)
        for fault in prepared.faults
    ]
    if recording.rejected:
        out.append(Finding(f"{recording.rejected} samples were rejected (not finite or repeated stamps)", False))
    return tuple(out)


def beyond_specification(solution: Solution) -> tuple[Finding, ...]:
    """Coefficients far outside the prior: a wrong specification, or an effect that this plan cannot tell from them."""
    sensors = solution.setup.sensors
    size = np.abs(solution.last.estimate) / sensors.stated
    return tuple(
        Finding(f"{sensors.names[i]} is {size[i]:.1f} times the sigma of the specification", False)
        for i in np.argsort(-size)
        if size[i] > _OUTSIDE
    )
