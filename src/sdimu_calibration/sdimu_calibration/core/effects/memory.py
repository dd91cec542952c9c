"""What a suspension remembers of the forces before: low-pass and play, one value a cycle.

Shapes are (n, 3), forces in units of g; what was before the first cycle is in `Motion.past`.
"""

from __future__ import annotations

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.compiled import compiled
from sdimu_calibration.core.effects.motion import Motion


def low_pass(motion: Motion, tau: float) -> Floats:
    """Force through a first-order lag, ``tau dy/dt = a - y``, at rest with the first force of all.

    Parameters
    ----------
    tau : float
        s.

    Returns
    -------
    ndarray, shape (n, 3)
        Mean of y over each cycle (g); exact for a force that is constant within a cycle.
    """
    y = _at_start(motion, "low-pass", tau)
    out = _low_pass(motion.dt, motion.a, tau, y)
    motion.left["low-pass", tau] = y
    return np.asarray(out)


def play(motion: Motion, band: float) -> Floats:
    """Force through a play (backlash) of half-width `band`: y follows a only once a pushes against an end.

    Source: Krasnosel'skii & Pokrovskii, *Systems with Hysteresis* (1989), operator of play; it starts in the middle.

    Parameters
    ----------
    band : float
        g.

    Returns
    -------
    ndarray, shape (n, 3)
        y after each cycle (g).
    """
    y = _at_start(motion, "play", band)
    out = _play(motion.a, band, y)
    motion.left["play", band] = y
    return np.asarray(out)


def _at_start(motion: Motion, kind: str, parameter: float) -> Floats:
    """Return y before the first cycle (3,) in g: what the block before has left, else the first force."""
    before = motion.past.get((kind, parameter))
    return np.array(motion.a[0] if before is None else before)


@compiled
def _low_pass(dt: Floats, a: Floats, tau: float, last: Floats) -> Floats:
    """Return the mean of y over each cycle; `last` (3,) is y before the first cycle, and moved to the end, in place."""
    out = np.empty(a.shape)
    for i in range(a.shape[1]):
        y = last[i]
        for k in range(a.shape[0]):
            share = dt[k] / tau
            gone = -np.expm1(-share)
            out[k, i] = a[k, i] + (y - a[k, i]) * gone / share
            y += (a[k, i] - y) * gone
        last[i] = y
    return out


@compiled
def _play(a: Floats, band: float, last: Floats) -> Floats:
    """Return y after each cycle; `last` (3,) is y before the first cycle, and moved to the end, in place."""
    out = np.empty(a.shape)
    for i in range(a.shape[1]):
        y = last[i]
        for k in range(a.shape[0]):
            y = min(max(y, a[k, i] - band), a[k, i] + band)
            out[k, i] = y
        last[i] = y
    return out
