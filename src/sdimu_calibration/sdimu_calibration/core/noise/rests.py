"""Static detection without a specification: the least scattered part of the recording gives the noise level."""

from __future__ import annotations

import numpy as np

from sdimu_calibration.core.arrays import Bools, Floats
from sdimu_calibration.core.recording import DataError, PhaseLog, Recording

WINDOW_S = 1.0
"""Length of a window (s): short against a dwell, long against vibration."""
_FEWEST = 10
"""Least number of samples of a window: the scatter of fewer is uncertain by more than a quarter."""
_QUIET = 20.0
"""Percentile of the scatter of all windows that is taken as noise: a fifth of every test is at rest."""
_RESTLESS = 3.0
"""Multiple of the noise from which a window is in motion: Gaussian noise of 10 samples does not reach it."""
_TURNING = np.radians(0.3)
"""Deviation of the mean rate that is a turn (rad/s): below the rates of tables, above the drift of a bias."""
_SHORTEST = 8
"""Least number of windows of a rest: without its first and last one, which are left to settling."""


def rests(recording: Recording) -> tuple[slice, ...]:
    """Find where the IMU is at rest.

    A window is at rest when all six channels scatter no more than the noise, its mean rate is that of the least
    scattered windows, no sample is missing, and the table, where its status is recorded, dwells throughout. The first
    and the last window of each rest are left out.

    Parameters
    ----------
    recording : Recording

    Returns
    -------
    tuple of slice
        Rows of the recording, in order.

    Raises
    ------
    DataError
        When there is no rest.
    """
    interval = recording.interval_s
    size = max(round(WINDOW_S / interval), _FEWEST)
    count = len(recording.t) // size
    data = np.hstack([recording.omega_ib_b, recording.f_ib_b])[: count * size].reshape(count, size, 6)
    still = np.zeros(0, dtype=bool)
    if count:
        scatter, mean_rate = data.std(axis=1), data[:, :, :3].mean(axis=1)
        limit = np.percentile(scatter, _QUIET, axis=0)
        quiet = np.all(scatter <= _RESTLESS * limit, axis=1)
        usual = np.median(mean_rate[quiet], axis=0) if quiet.any() else mean_rate[0]
        near = np.abs(mean_rate - usual) < _TURNING + 6.0 * limit[:3] / np.sqrt(size)
        still = quiet & near.all(axis=1) & _whole(recording.t, size, count, interval)
        still &= _dwells(recording.phase, recording.t[: count * size].reshape(count, size), interval)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], still.astype(int), [0]])))
    found = tuple(
        slice(int(a + 1) * size, int(b - 1) * size)
        for a, b in zip(edges[::2], edges[1::2], strict=True)
        if b - a - 2 >= _SHORTEST
    )
    if not found:
        raise DataError(
            f"/imu/data_raw: no rest of {_SHORTEST + 2} s in {recording.t[-1]:.0f} s; record the IMU while it stands "
            "still, an hour or more for its slow noise"
        )
    return found


def _whole(t: Floats, size: int, count: int, interval: float) -> Bools:
    """Windows without a missing sample, counted from the last sample of the window before."""
    edges = np.concatenate([[t[0] - interval], t[size - 1 : count * size : size]])
    whole: Bools = np.abs(np.diff(edges) - size * interval) < 0.5 * interval
    return whole


def _dwells(log: PhaseLog | None, t: Floats, interval: float) -> Bools:
    """Windows in which the table dwells throughout, all of them without a status; `t` (count, size)."""
    if log is None or not len(log.t):
        return np.ones(len(t), dtype=bool)
    first = np.maximum(np.searchsorted(log.t, t[:, 0] - interval + 1e-6, side="right") - 1, 0)
    last = np.maximum(np.searchsorted(log.t, t[:, -1] - 1e-6, side="right") - 1, 0)
    turning = np.concatenate([[0], np.cumsum(~log.dwell)])
    same: Bools = (turning[last + 1] == turning[first]) & (log.stop[first] == log.stop[last])
    return same
