"""Measurements that a user leaves out of all fits: whole stops, or spans of time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from sdimu_calibration.core.alignment.prepared import ALIGN_S, PreparedData
from sdimu_calibration.core.arrays import Bools, Ints
from sdimu_calibration.core.measurement_kind import ALL, SKIP
from sdimu_calibration.core.recording import DataError


def without(prepared: PreparedData, stops: Sequence[int], spans: Sequence[tuple[float, float]]) -> PreparedData:
    """Leave measurements out; the samples are still navigated.

    Parameters
    ----------
    stops : sequence of int
        Numbers of stops.
    spans : sequence of (float, float)
        Begin and end (s): every epoch that one touches is left out.
    """
    if not stops and not spans:
        return prepared
    stop, measured = prepared.phases.stop, prepared.kind != SKIP
    for number in stops:
        if not (measured & (stop == number)).any():
            raise DataError(f"stop {number} has no measurements in this recording: leave out others")
    if stops and int(stop[np.argmax(measured)]) in stops:
        raise DataError("stops left out: keep the first one, which gives the attitude")
    out = measured & (np.isin(stop, list(stops)) | _touched(prepared, spans))
    if len(np.unique(stop[measured & ~out])) < 2:
        raise DataError("stops and times left out: keep at least one stop besides the first, which gives the attitude")
    return replace(prepared, kind=_handed_on(prepared, out))


def _touched(prepared: PreparedData, spans: Sequence[tuple[float, float]]) -> Bools:
    epochs, out = prepared.epochs, np.zeros(len(prepared.epochs), dtype=bool)
    first = float(epochs.start[np.argmax(prepared.phases.dwell)])
    for begin, end in spans:
        if not begin < end:
            raise DataError(f"times left out: {begin:g}-{end:g} s ends before it begins (expected BEGIN-END)")
        if begin < first + ALIGN_S:
            raise DataError(
                f"times left out: {begin:g}-{end:g} s begins in the first {ALIGN_S:.0f} s of the first stop, which "
                "give the attitude: leave out later ones"
            )
        if begin >= epochs.end[-1]:
            raise DataError(
                f"times left out: {begin:g}-{end:g} s begins after the recording, which is {epochs.end[-1]:.0f} s long"
            )
        out |= (epochs.end > begin) & (epochs.start < end)
    return out


def _handed_on(prepared: PreparedData, out: Bools) -> Ints:
    """Kinds (e,) without the epochs `out` (e,): position and velocity are measured by the next epoch of the stop."""
    kind, stop = np.where(out, SKIP, prepared.kind).astype(np.int64), prepared.phases.stop
    for k in np.flatnonzero(out & (prepared.kind == ALL)):
        later = np.flatnonzero((kind[k:] != SKIP) & (stop[k:] == stop[k]))
        if len(later):
            kind[k + later[0]] = ALL
    return kind
