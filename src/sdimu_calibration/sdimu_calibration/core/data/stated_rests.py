"""Rests that somebody states: a table by its phase, or a user by a list of times.

Who states a rest knows that the IMU was not turned on purpose; when it came to lie still, the samples know better. So a
stated rest counts from the first to the last moment in it that is still at the widest threshold of detection.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sdimu_calibration.core.arrays import Ints
from sdimu_calibration.core.data.static_detection import (
    HOLE,
    SHORTEST_S,
    WINDOW_S,
    StaticIntervals,
    detect_static,
    noise_at,
    still_samples,
)
from sdimu_calibration.core.data.trembling_rests import STEPS
from sdimu_calibration.core.recording import DataError, PhaseLog, Recording
from sdimu_calibration.core.wording import Option

Spans = Sequence[tuple[float, float]]
_TURNS = np.radians(5.0)
"""Mean rate against that of the other rests (rad/s) from which a stated rest is a turn: a hand that holds an IMU for a
second drifts by less, and the bias of no gyro changes by so much from attitude to attitude."""
_FEWEST = 3
"""Number of samples of a rest at least: fewer give no scatter."""


def dwells_of(phase: PhaseLog | None, until_s: float) -> tuple[tuple[float, float], ...]:
    """Spans (s) of the dwells that somebody stated; none where they were detected.

    Parameters
    ----------
    until_s : float
        End of the recording (s).
    """
    if phase is None or not phase.stated:
        return ()
    # A rest ends where the phase says rotating, or another stop.
    new = np.append(True, (phase.dwell[1:] != phase.dwell[:-1]) | (phase.stop[1:] != phase.stop[:-1]))
    begin = np.flatnonzero(new)
    until = np.append(phase.t[begin[1:]], until_s)
    spans = zip(phase.t[begin].tolist(), until.tolist(), phase.dwell[begin].tolist(), strict=True)
    return tuple((a, b) for a, b, dwells in spans if dwells and b - a >= SHORTEST_S)


def stated_rests(recording: Recording, spans: Spans, by_user: bool = True) -> StaticIntervals:
    """Find where the IMU lies still within spans.

    Parameters
    ----------
    spans : sequence of (float, float)
        Begin and end (s after the first sample), one a rest.
    by_user : bool
        A span that is no rest is refused; else it is left out.
    """
    width = max(round(WINDOW_S / recording.interval_s), 4)
    turning = float(_TURNS)
    still = still_samples(recording, width, turning, HOLE, STEPS[-1])
    found = []
    for begin, end in sorted(spans):
        a, b = (int(k) for k in np.searchsorted(recording.t, [begin - 1e-9, end + 1e-9]))
        inside = np.flatnonzero(still[a:b])
        if len(inside) >= _FEWEST:
            found.append((a + int(inside[0]), a + int(inside[-1]) + 1))
        elif by_user:
            if b - a < _FEWEST:
                raise DataError(
                    f"{Option.RESTS} {begin:g}-{end:g}: {b - a} samples of /imu/data_raw are in it (it has "
                    f"{recording.t[-1]:.1f} s): state seconds since its first sample"
                )
            found.append((a, b))
    if not found:
        raise DataError("/imu/data_raw: the IMU lies still in none of the stated dwells: check their times")
    first, last = np.array(found).T
    _refuse_overlap(recording, first, last)
    if by_user:
        _refuse_turns(recording, first, last)
    return StaticIntervals(first, last, *_noise(recording, first, last))


def _refuse_overlap(recording: Recording, first: Ints, last: Ints) -> None:
    over = np.flatnonzero(first[1:] < last[:-1])
    if len(over):
        at = recording.t[first[over[0] + 1]]
        raise DataError(f"{Option.RESTS}: two of the rests overlap at {at:.1f} s: state each once")


def _refuse_turns(recording: Recording, first: Ints, last: Ints) -> None:
    mean = np.array([recording.omega_ib_b[a:b].mean(axis=0) for a, b in zip(first, last, strict=True)])
    off = np.max(np.abs(mean - np.median(mean, axis=0)), axis=1)
    worst = int(np.argmax(off))
    if off[worst] > _TURNS:
        raise DataError(
            f"{Option.RESTS}: from {recording.t[first[worst]]:.1f} to {recording.t[last[worst] - 1]:.1f} s the IMU "
            f"turns by {np.degrees(off[worst]):.1f} deg/s: it is no rest; times are seconds since the first sample"
        )


def _noise(recording: Recording, first: Ints, last: Ints) -> tuple[float, float]:
    """White noise of both triads: of the quiet rests where there are any, else of the stated ones."""
    try:
        quiet = detect_static(recording)
    except DataError:
        return noise_at(recording, first, last)
    return quiet.gyro_white_noise, quiet.accel_white_noise


def without_spans(recording: Recording, rests: StaticIntervals, spans: Spans) -> StaticIntervals:
    """Take spans of time out of rests: of one that they cut the longest piece stays, if it is long enough for a rest.

    Parameters
    ----------
    spans : sequence of (float, float)
        s after the first sample.
    """
    if not spans:
        return rests
    shortest = max(round(SHORTEST_S / recording.interval_s), _FEWEST)
    taken = np.zeros(len(recording.t), dtype=bool)
    for begin, end in spans:
        _refuse_beyond(recording, begin, end)
        taken[np.searchsorted(recording.t, begin) : np.searchsorted(recording.t, end, side="right")] = True
    kept = []
    for a, b in zip(rests.first.tolist(), rests.last.tolist(), strict=True):
        if not taken[a:b].any():
            # However short: whoever found it took it for a rest.
            kept.append((a, b))
            continue
        cut = np.concatenate([[a - 1], a + np.flatnonzero(taken[a:b]), [b]])
        k = int(np.argmax(np.diff(cut)))
        if cut[k + 1] - cut[k] - 1 >= shortest:
            kept.append((int(cut[k]) + 1, int(cut[k + 1])))
    if not kept:
        raise DataError(f"/imu/data_raw: {Option.EXCLUDE_TIMES} takes every rest away: leave some of the spans out")
    first, last = np.array(kept).T
    return StaticIntervals(first, last, rests.gyro_white_noise, rests.accel_white_noise)


def _refuse_beyond(recording: Recording, begin: float, end: float) -> None:
    if not begin < end:
        raise DataError(f"times left out: {begin:g}-{end:g} s is empty or backwards (expected BEGIN-END)")
    if begin > recording.t[-1]:
        raise DataError(
            f"times left out: {begin:g}-{end:g} s begins after the recording, which is {recording.t[-1]:.0f} s long"
        )
