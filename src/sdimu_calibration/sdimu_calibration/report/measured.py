"""Numbers behind "measured against predicted": every channel, table angles, and what each turn leaves."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sdimu_calibration.core.arrays import Floats, Ints
from sdimu_calibration.core.diagnosis.diagnose import Diagnosis
from sdimu_calibration.core.diagnosis.plan_seen import plan_seen
from sdimu_calibration.core.recording import TableLog
from sdimu_calibration.core.units import from_si
from sdimu_calibration.report.data import Residuals

UNITS = ("mm",) * 3 + ("mm/s",) * 3 + ("deg/h",) * 3 + ("g",) * 3
"""Unit of each channel in `Overlay`."""


@dataclass(frozen=True)
class Overlay:
    """Measured and predicted values of the twelve channels, one row a stop, in `UNITS`."""

    t: Floats
    """Middle of each stop (s), shape (s,)."""
    measured: Floats
    predicted: Floats
    """`measured`, `predicted`: shape (s, 12). NaN where not measured. Rate and specific force: what the sensors say,
    and what the model with everything found says that they should, means over the stop. Position and velocity: what
    navigation with the model as given says after the turn, where rest is the truth, and what the found effects make of
    it."""


def overlay(diagnosis: Diagnosis, found: Residuals) -> Overlay:
    """Lay measured and predicted values out by stop."""
    epochs = diagnosis.navigation.prepared.epochs
    factor = np.array([from_si(1.0, unit) for unit in (*UNITS[:9], "ug", "ug", "ug")])
    factor[9:] *= 1e-6
    before, after = found.before * found.sigma * factor, found.after * found.sigma * factor
    sensed = np.column_stack([epochs.w_mean, epochs.f_mean]) * factor[6:]
    measured, predicted = before, before - after
    measured[:, 6:] = np.where(np.isfinite(after[:, 6:]), sensed, np.nan)
    predicted[:, 6:] = measured[:, 6:] - after[:, 6:]
    stops = np.unique(found.stop[np.isfinite(after).any(axis=1)])
    rows = [(found.stop == stop) & np.isfinite(after[:, 8]) for stop in stops]
    return Overlay(
        np.array([found.t[r].mean() for r in rows]),
        np.array([_mean(measured[r]) for r in rows]),
        np.array([_mean(predicted[r]) for r in rows]),
    )


def _mean(values: Floats) -> Floats:
    """Mean of each column over what is finite; NaN where nothing is."""
    count = np.isfinite(values).sum(axis=0)
    return np.asarray(np.where(count > 0, np.nansum(values, axis=0) / np.maximum(count, 1), np.nan))


def table_angles(table: TableLog, t: Floats) -> Floats:
    """Angle of each axis of the table at times `t` (e,), in deg between -180 and 180, shape (e, k)."""
    angle = np.column_stack([np.interp(t, table.t, table.angle[:, k]) for k in range(len(table.names))])
    return np.asarray(np.degrees(np.arctan2(np.sin(angle), np.cos(angle))))


@dataclass(frozen=True)
class Jumps:
    """What navigation says in the first second after each turn about one body axis, m turns."""

    axis: Ints
    """Shape (m,)."""
    angle: Floats
    """Signed (deg), shape (m,)."""
    stop: Ints
    """At which it ends, shape (m,)."""
    before: Floats
    after: Floats
    """`before`, `after`: velocity innovation N, E, D in sigmas, with the model as given and with what was found,
    shape (m, 3)."""


def jumps(diagnosis: Diagnosis, found: Residuals) -> Jumps:
    """Join turns with the velocity measured after them."""
    taken: list[tuple[int, float, int]] = []
    for turn, (_, _, end) in zip(plan_seen(diagnosis.navigation).turns, diagnosis.navigation.times.turns, strict=True):
        rows = np.flatnonzero((found.t > end) & np.isfinite(found.before[:, 3]))
        if len(rows) and turn.axis is not None:
            taken.append((turn.axis, float(np.degrees(turn.angle)), int(rows[0])))
    row = np.array([r for _, _, r in taken], dtype=np.int64)
    return Jumps(
        np.array([a for a, _, _ in taken], dtype=np.int64),
        np.array([b for _, b, _ in taken]),
        found.stop[row],
        found.before[row, 3:6],
        found.after[row, 3:6],
    )
