"""Faults in the data that are no physics: looked at first, because they pass for effects otherwise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sdimu_calibration.core.passes import Reduced, Solution
from sdimu_calibration.core.recording import Recording

_STUCK = 5
_COUNTED, _COARSE = 1000, 50
"""A sensor that shows fewer than so many values in so many samples is coarsely quantised."""
_OUTSIDE = 4.5
"""Thirty coefficients of a sensor within its specification pass this once in 5000 tests."""


@dataclass(frozen=True)
class Finding:
    """A fault: what, and whether results can still be trusted without mending it."""

    text: str
    grave: bool


def screen(recording: Recording, reduced: Reduced) -> tuple[Finding, ...]:
    """Look for gaps, stuck sensors, saturation and contradictions."""
    out: list[Finding] = []
    lost = int(reduced.cycles.lost.sum())
    if lost:
        turning = float(np.abs(reduced.cycles.gap_angle).sum()) > np.radians(0.01)
        where = " in a turn" if turning else " at rest"
        out.append(Finding(f"{lost} samples are missing by their stamps{where}", turning))
    if recording.rejected:
        out.append(Finding(f"{recording.rejected} samples were rejected (not finite or repeated stamps)", False))
    for triad, data in (("gyro", recording.omega_ib_b), ("accelerometer", recording.f_ib_b)):
        for axis in range(3):
            x = data[:, axis]
            if len(np.unique(x[:_COUNTED])) < _COARSE:
                # Counts coarser than the noise repeat by themselves: neither stuck nor clipped can be told from them.
                continue
            same = np.flatnonzero(np.diff(x) != 0.0)
            longest = int(np.max(np.diff(np.concatenate([[-1], same, [len(x) - 1]]))))
            if longest * recording.interval_s > _STUCK:
                seconds = longest * recording.interval_s
                out.append(Finding(f"{triad} {'xyz'[axis]} shows the same number for {seconds:.0f} s", True))
            top = np.abs(x) >= np.abs(x).max() * (1.0 - 1e-12)
            if top.sum() > 20:
                text = f"{triad} {'xyz'[axis]} stands at its largest value in {int(top.sum())} samples: saturated?"
                out.append(Finding(text, True))
    contradicted = float((reduced.epochs.end - reduced.epochs.start)[reduced.phases.contradicted].sum())
    if contradicted > 5.0:
        out.append(Finding(f"the table said dwell for {contradicted:.0f} s in which the IMU moved", False))
    return tuple(out)


def beyond_specification(solution: Solution) -> tuple[Finding, ...]:
    """Coefficients far outside the prior: a wrong specification, or an effect that this plan cannot tell from them."""
    sensors = solution.setup.sensors
    size = np.abs(solution.last.estimate) / sensors.prior
    return tuple(
        Finding(f"{sensors.names[i]} is {size[i]:.1f} times the sigma of the specification", False)
        for i in np.argsort(-size)
        if size[i] > _OUTSIDE
    )
