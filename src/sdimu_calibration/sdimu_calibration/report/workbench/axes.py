"""What residuals can be drawn against: time, stop, attitude, temperature, the turn before, rate and specific force."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.diagnosis.diagnose import Diagnosis
from sdimu_calibration.core.effects.motion import Motion
from sdimu_calibration.core.evidence.navigation_evidence import NavigationEvidence
from sdimu_calibration.report import data

TIME, STOP = "time (s)", "stop"


def axes(diagnosis: Diagnosis) -> Mapping[str, Floats]:
    """Give every variable at every epoch.

    Parameters
    ----------
    diagnosis : Diagnosis
        Of a fit that navigates.

    Returns
    -------
    mapping of str to ndarray, shape (e,)
        By what stands at the axis, unit included; the first one is the usual one.
    """
    evidence = diagnosis.navigation
    epochs, seen, log = evidence.prepared.epochs, evidence.seen, evidence.prepared.temperature
    out = {TIME: epochs.end, STOP: evidence.prepared.phases.stop.astype(float)}
    out |= _attitude(seen.C_nb[epochs.last - 1])
    if log is not None and len(log.t):
        rise = data.variables(diagnosis)[:, -1]
        out["temperature (deg C)"] = log.origin_degc + rise
    out |= {f"turn before, {axis} (deg/s)": turn for axis, turn in zip("xyz", _turns(evidence).T, strict=True)}
    means = data.variables(diagnosis)
    names = {"a": "specific force", "w": "rate"}
    for k, (name, unit) in enumerate(data.VARIABLES[:6]):
        out[f"{names[name[0]]} {name[-1]} ({unit})"] = means[:, k]
    return out


def _attitude(C_nb: Floats) -> dict[str, Floats]:
    """Roll, pitch and heading (deg) of attitudes (e, 3, 3)."""
    angles = (
        np.arctan2(C_nb[:, 2, 1], C_nb[:, 2, 2]),
        np.arcsin(np.clip(-C_nb[:, 2, 0], -1.0, 1.0)),
        np.arctan2(C_nb[:, 1, 0], C_nb[:, 0, 0]),
    )
    return {
        f"{name} (deg)": np.degrees(angle) for name, angle in zip(("roll", "pitch", "heading"), angles, strict=True)
    }


def _turns(evidence: NavigationEvidence) -> Floats:
    """Mean body rate (deg/s) in the turn before the stop of every epoch, (e, 3); zero before the first turn."""
    stop, seen = evidence.prepared.phases.stop, evidence.seen
    out = np.zeros((len(stop), 3))
    for number, begin, end in evidence.times.turns:
        out[stop > number] = _rate(seen, begin, end)
    return out


def _rate(seen: Motion, begin: float, end: float) -> Floats:
    rows = (seen.t > begin) & (seen.t <= end) & (np.abs(seen.w_table).max(axis=1) > 0.0)
    seconds = float(seen.dt[rows].sum())
    turned = (seen.w_table[rows] * seen.dt[rows, None]).sum(axis=0)
    return np.degrees(turned) / seconds if seconds else np.zeros(3)
