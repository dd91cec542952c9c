"""Steps of the clock by whole sample intervals: by their stamps alone they are missing samples.

A clock that is set on by 10 ms in a turn at 100 Hz leaves the stamps of one missing sample. The bridge of a missing
sample turns the body on; after a step of the clock it must not. Gravity in the rests before and after decides: with
C the rotation that the gyros tell from one rest to the next, and f0 and f1 the mean forces in them,

    f1 - C f0  =  b - C b + M f1 - C M f0 + phi x f1
    phi = T (w1 - d - G f1) + sum_t C_t (d + N w_t + G f_t) dt + h theta

where b, M are errors of the accelerometers, d, N, G those of the gyros (G by the force), C_t turns from t to the second
rest, T is the time of the turn, w1 the mean rate in the second rest (the Earth's, which C_t brings there from every t),
and theta the angle that the bridge of the gap adds. h is 0 for missing samples and 1 for a step of the clock. All turns
together are one least squares with wide priors; h of a gap is known where its sigma is small against one. A turn about
the vertical, or gyros without the resolution, leave it open: the samples are then taken as missing.
Source: own derivation.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from sdimu_calibration.core.arrays import Floats, Ints
from sdimu_calibration.core.recording import ClockStep, PhaseLog, Recording
from sdimu_calibration.core.rotation import rotation_matrix, skew

_LONGEST_S = 0.5
"""Length of a gap (s) at most: no clock that is set on in a test is set on by more, as for uneven steps."""
_WHOLE = 0.05
"""Distance (intervals) from whole intervals at most: what is further is told by the stamps alone."""
_REST_S = 20.0
"""Length of the mean force in a rest (s) at most: white noise is averaged, drift is not yet seen."""
_MARGIN_S = 0.5
"""Time (s) beside a turn that counts as turn: a status comes late, and a table settles."""
_FEWEST = 3
"""Number of turns without a gap at least: fewer say nothing of the sensors' errors."""
_CERTAIN = 8.0
"""Logarithm (nat) of the odds of a step of the clock from which it is taken as one: missing samples are usual."""
_KNOWN = 0.15
"""Ratio of the sigma of h to a whole step at most: with less resolution chance finds a step among many gaps."""
_MOST = 100_000
"""Number of samples of a turn at most: minutes at any rate; what is longer is no turn of a table."""
_SIGMAS = np.repeat([0.5, 0.05, 0.02, 0.05, 1e-4], [3, 9, 3, 9, 9])
"""Priors (sigma) of b (m/s^2), M, d (rad/s), N and G (rad/s per m/s^2): wider than those of any grade."""
_LEAST_FORCE = 1e-5
"""Noise of a mean force (m/s^2) at least: a microgravity."""

_ACROSS = np.array(
    [
        [[0.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]],
        [[0.0, 0.0, 1.0], [0.0, 0.0, 0.0], [-1.0, 0.0, 0.0]],
        [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]],
    ]
)
"""Matrix of the cross product, shape (3, 3, 3): skew(v) = _ACROSS @ v."""


class _Turn(NamedTuple):
    """One equation: design of the sensors' errors (3, 33), misclosure (3,), and the effect of the gap's h (3,)."""

    design: Floats
    misclosure: Floats
    effect: Floats
    row: int


def without_whole_steps(recording: Recording) -> Recording:
    """Take steps of the clock by whole intervals out of the times where gravity tells them from missing samples.

    Parameters
    ----------
    recording : Recording
        In SI, with rests.

    Returns
    -------
    Recording
        The steps are in its `clock_steps`; the same object where there are none.
    """
    if recording.phase is None or len(recording.t) < 2:
        return recording
    gaps = _gaps(recording)
    if not len(gaps):
        return recording
    turns = _turns(recording, recording.phase, gaps)
    for row, sigma in sorted(_told(turns).items(), reverse=True):
        recording = _undone(recording, row, sigma)
    return recording


def _gaps(recording: Recording) -> Ints:
    """Rows of the samples after whole missing intervals."""
    step = np.diff(recording.t) / recording.interval_s
    missing = np.rint(step) - 1.0
    few = (missing >= 1.0) & (missing * recording.interval_s <= _LONGEST_S)
    return np.flatnonzero(few & (np.abs(step - missing - 1.0) < _WHOLE)) + 1


def _turns(recording: Recording, phase: PhaseLog, gaps: Ints) -> list[_Turn]:
    """Every turn between two rests, with at most one gap in it."""
    t = recording.t
    change = np.flatnonzero(np.diff(phase.dwell.astype(np.int8)))
    edges = phase.t[change + 1]
    pieces = []
    for k in np.flatnonzero(phase.dwell[change][:-1]):
        first, last = edges[k] - _MARGIN_S, edges[k + 1] + _MARGIN_S
        before = edges[k - 1] + _MARGIN_S if k else t[0]
        after = edges[k + 2] - _MARGIN_S if k + 2 < len(edges) else t[-1]
        rows = [
            slice(*np.searchsorted(t, (low, high)))
            for low, high in ((max(before, first - _REST_S), first), (first, last), (last, min(after, last + _REST_S)))
        ]
        if min(row.stop - row.start for row in rows) < 10 or rows[1].stop - rows[1].start > _MOST:
            continue
        inside = gaps[(gaps >= rows[1].start) & (gaps < rows[1].stop)]
        if len(inside) <= 1:
            pieces.append((rows, int(inside[0]) if len(inside) else -1))
    if not pieces:
        return []
    # In many attitudes the Earth's rate is no bias.
    bias = np.mean([recording.omega_ib_b[rows[2]].mean(axis=0) for rows, _ in pieces], axis=0)
    return [_turn(recording, rows, gap, bias) for rows, gap in pieces]


def _turn(recording: Recording, rows: list[slice], gap: int, bias: Floats) -> _Turn:
    """Integrate the gyros over a turn, with a gap bridged by the mean of its neighbours; `bias` (3,) about theirs."""
    omega, force = recording.omega_ib_b, recording.f_ib_b
    f0, f1 = force[rows[0]].mean(axis=0), force[rows[2]].mean(axis=0)
    w, earth = omega[rows[1]] - bias, omega[rows[2]].mean(axis=0) - bias
    dt, theta = recording.interval_s, np.zeros(3)
    steps = _rotations(-w * dt)
    if gap >= 0:
        j = gap - rows[1].start
        missing = recording.t[gap] - recording.t[gap - 1] - dt
        angle = 0.5 * (w[j] + w[max(j - 1, 0)]) * missing
        steps[j] = steps[j] @ rotation_matrix(-angle)
    to_end = _products(steps)
    if gap >= 0:
        theta = to_end[j] @ angle
    C, to_end, T = to_end[0], to_end[:-1], float(recording.t[rows[1].stop - 1] - recording.t[rows[1].start - 1])
    turned = np.einsum("nij,nk->ijk", to_end, w * dt)
    pulled = np.einsum("nij,nk->ijk", to_end, force[rows[1]] * dt)
    across = skew(f1)
    design = np.hstack(
        [
            np.eye(3) - C,
            np.einsum("ij,k->ijk", np.eye(3), f1).reshape(3, 9) - np.einsum("ij,k->ijk", C, f0).reshape(3, 9),
            -across @ (to_end.sum(axis=0) * dt - T * np.eye(3)),
            -across @ turned.reshape(3, 9),
            -across @ (pulled - T * np.einsum("ij,k->ijk", np.eye(3), f1)).reshape(3, 9),
        ]
    )
    return _Turn(design, f1 - C @ f0 + across @ earth * T, -across @ theta, gap)


def _rotations(phi: Floats) -> Floats:
    """Rotation matrices of rotation vectors (n, 3), as `rotation_matrix`; shape (n, 3, 3)."""
    angle = np.sqrt(np.sum(phi**2, axis=1))[:, None, None]
    K = np.einsum("ijk,nk->nij", _ACROSS, phi)
    half = 0.5 * np.sinc(0.5 * angle / np.pi) ** 2
    return np.asarray(np.eye(3) + np.sinc(angle / np.pi) * K + half * (K @ K))


def _products(steps: Floats) -> Floats:
    """Products from each of n matrices to the last, which stands leftmost; (n + 1, 3, 3), the identity at the end."""
    out, reach = steps.copy(), 1
    while reach < len(out):
        out[:-reach] = out[reach:] @ out[:-reach]
        reach *= 2
    return np.concatenate([out, np.eye(3)[None]])


def _told(turns: list[_Turn]) -> dict[int, float]:
    """Rows of the gaps that are steps of the clock, with the sigma of h."""
    marked = [k for k, turn in enumerate(turns) if turn.row >= 0]
    if not marked or len(turns) - len(marked) < _FEWEST:
        return {}
    X = np.vstack([turn.design for turn in turns])
    H = np.zeros((3 * len(turns), len(marked)))
    for column, k in enumerate(marked):
        H[3 * k : 3 * k + 3, column] = turns[k].effect
    X, y = np.hstack([X, H]), np.concatenate([turn.misclosure for turn in turns])
    prior = np.diag(np.concatenate([_SIGMAS, np.ones(len(marked))]) ** -2.0)
    start = np.concatenate([np.zeros(len(_SIGMAS)), np.full(len(marked), 0.5)])
    sigma = 1e-2
    for _ in range(6):
        P = np.linalg.inv(X.T @ X / sigma**2 + prior)
        x = start + P @ X.T @ (y - X @ start) / sigma**2
        free = max(len(y) - float(np.trace(P @ X.T @ X)) / sigma**2, 1.0)
        sigma = max(float(np.sqrt(np.sum((y - X @ x) ** 2) / free)), _LEAST_FORCE)
    h, variance = x[len(_SIGMAS) :], np.diag(P)[len(_SIGMAS) :]
    odds = (h**2 - (h - 1.0) ** 2) / (2.0 * variance)
    # What is as far from one as from nothing is neither.
    found = (odds > _CERTAIN) & (variance < _KNOWN**2) & (np.abs(h - 1.0) < 0.5)
    return {turns[marked[column]].row: float(np.sqrt(variance[column])) for column in np.flatnonzero(found)}


def _undone(recording: Recording, row: int, sigma: float) -> Recording:
    """Take one step out of all times; `sigma` of its h."""
    t = recording.t
    size, at = float(t[row] - t[row - 1] - recording.interval_s), float(t[row])

    def earlier(times: Floats) -> Floats:
        return np.where(times >= at - 1e-9, times - size, times)

    phase, temperature, table = recording.phase, recording.temperature, recording.table
    mine = ClockStep(at - size, size, sigma)
    later = [step._replace(t=step.t - size) if step.t > at - size else step for step in recording.clock_steps]
    return replace(
        recording,
        t=earlier(t),
        phase=phase and replace(phase, t=earlier(phase.t)),
        temperature=temperature and replace(temperature, t=earlier(temperature.t)),
        table=table and replace(table, t=earlier(table.t)),
        clock_steps=tuple(sorted((*later, mine))),
    )
