"""A status whose clock is not that of the IMU: its offset is what brings its turns onto those the IMU felt."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sdimu_calibration.core.arrays import Bools, Floats
from sdimu_calibration.core.data.windows import cut_windows
from sdimu_calibration.core.recording import PhaseLog, Recording

_STEP_S = 0.25
"""Step of the grid on which motion is compared (s): finer than the status."""
_AGREES = 0.6
"""Least correlation of motion and status (1): from here on they are of one test."""
_TOLERATED_S = 0.75
"""Offset of a status that is left as it is (s): it comes once a second, and the guard by the IMU takes care of less."""
_AS_GOOD = 0.02
"""Difference of correlation (1) of shifts that agree as well: plans repeat themselves, and the smallest is taken."""
_NEAR_S = 5.0
"""Distance of changes of status and of motion (s) after the coarse shift: further apart they are not the same event."""
_TOGETHER_S = 0.6
"""Scatter of those distances (s, median deviation): more is no offset of clocks, as the status comes once a second."""
_FEWEST = 3
"""Number of changes that must agree: fewer are chance."""
_LONGEST = 2**22
"""Length of the grid (steps) beyond which clocks are not compared: two weeks, and 0.3 GB for the transforms."""


def aligned(recording: Recording) -> Recording:
    """Shift the status onto the clock of the IMU where the motion shows that it is off.

    Returns
    -------
    Recording
        The same object when nothing is to be done; else with a note. A status that has nothing in common with the
        motion, at any shift and outside of the IMU's time, is left out.
    """
    log = recording.phase
    if log is None or len(log.t) < 2 or log.dwell.all() or not log.dwell.any():
        return recording
    windows = cut_windows(recording.t, recording.omega_ib_b, recording.f_ib_b, _STEP_S)
    if len(windows) < 4 or windows.still.all():
        return recording
    step = windows.length * windows.interval_s
    if max(windows.end[-1] - windows.start[0], log.t[-1] - log.t[0]) > _LONGEST * step:
        note = "samples or status extend over more than two weeks by their stamps: their clocks are not compared"
        return replace(recording, notes=(*recording.notes, note))
    moving, begin = _on_grid(windows.end - 0.5 * step, ~windows.still, step)
    rotating = _status_on_grid(log, step)
    now, best, shift = _best_shift(moving, begin, rotating, float(log.t[0]), step)
    if best < _AGREES:
        return _without_common_time(recording, log)
    # A shift of less than a turn hardly changes the correlation: the changes of motion themselves say it.
    shift = shift if best - now > _AS_GOOD else 0.0
    shift += _refinement(windows.end - 0.5 * step, ~windows.still, log, shift)
    if abs(shift) < _TOLERATED_S:
        return recording
    note = f"the status is {abs(shift):.1f} s {'early' if shift > 0 else 'late'} against the motion of the IMU: shifted"
    return replace(recording, phase=replace(log, t=log.t + shift), notes=(*recording.notes, note))


def _without_common_time(recording: Recording, log: PhaseLog) -> Recording:
    if log.t[0] < recording.t[-1] and log.t[-1] > 0.0:
        return recording
    note = "the status has neither the times nor the motion of the IMU: not used"
    return replace(recording, phase=None, notes=(*recording.notes, note))


def _on_grid(t: Floats, flag: Bools, step: float) -> tuple[Floats, float]:
    """Put flags on the grid as 1, 0 and, where it is unknown, the mean; also return the time of the first."""
    place = np.rint((t - t[0]) / step).astype(np.int64)
    out = np.full(int(place[-1]) + 1, float(flag.mean()))
    out[place] = flag
    return out, float(t[0])


def _status_on_grid(log: PhaseLog, step: float) -> Floats:
    """1 while rotating, 0 while dwelling, from the first status to the last."""
    t = np.arange(log.t[0], log.t[-1], step)
    return np.asarray(~log.dwell[np.searchsorted(log.t, t, side="right") - 1], dtype=np.float64)


def _best_shift(moving: Floats, begin: float, status: Floats, status_begin: float, step: float) -> tuple[float, ...]:
    """Correlation without a shift, the largest one, and its shift (s), by the Fourier transform."""
    a, b = moving - moving.mean(), status - status.mean()
    size = int(2 ** np.ceil(np.log2(len(a) + len(b))))
    product = np.fft.rfft(a, size) * np.conj(np.fft.rfft(b, size))
    r = np.fft.irfft(product, size) / max(float(np.sqrt(np.sum(a**2) * np.sum(b**2))), 1e-12)
    lag = np.arange(size)
    lag[lag >= len(a)] -= size
    shift = begin + lag * step - status_begin
    good = np.flatnonzero(r > r.max() - _AS_GOOD)
    best = int(good[np.argmin(np.abs(shift[good]))])
    return float(r[np.argmin(np.abs(shift))]), float(r[best]), float(shift[best])


def _refinement(t: Floats, moving: Bools, log: PhaseLog, shift: float) -> float:
    """Median distance (s) of the changes of motion from those of the shifted status."""
    felt = t[1:][moving[1:] != moving[:-1]]
    said = log.t[1:][log.dwell[1:] != log.dwell[:-1]] + shift
    if not len(felt) or not len(said):
        return 0.0
    after = np.searchsorted(felt, said)
    distance = np.stack([felt[np.maximum(after - 1, 0)], felt[np.minimum(after, len(felt) - 1)]]) - said
    nearest = np.where(np.abs(distance[0]) <= np.abs(distance[1]), *distance)
    near = nearest[np.abs(nearest) < _NEAR_S]
    if len(near) < _FEWEST:
        return 0.0
    middle = float(np.median(near))
    return middle if float(np.median(np.abs(near - middle))) < _TOGETHER_S else 0.0
