"""What a suspension remembers of the forces before: low-pass and play, one value a cycle.

Shapes are (n, 3), forces in units of g; the motion before the first cycle is `Motion.past`.
"""

from __future__ import annotations

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.compiled import compiled
from sdimu_calibration.core.effects.motion import Motion
from sdimu_calibration.core.units import STANDARD_GRAVITY


def low_pass(motion: Motion, tau: float) -> Floats:
    """Force through a first-order lag, ``tau dy/dt = a - y``, at rest with the first force of all.

    Parameters
    ----------
    motion : Motion
    tau : float
        s.

    Returns
    -------
    ndarray, shape (n, 3)
        Mean of y over each cycle (g); exact for a force that is constant within a cycle.
    """
    dt, a = _history(motion)
    return np.asarray(_low_pass(dt, a, tau)[len(motion.past) :])


def play(motion: Motion, band: float) -> Floats:
    """Force through a play (backlash) of half-width `band`: y follows a only once a pushes against an end.

    Source: Krasnosel'skii & Pokrovskii, *Systems with Hysteresis* (1989), operator of play; it starts in the middle.

    Parameters
    ----------
    motion : Motion
    band : float
        g.

    Returns
    -------
    ndarray, shape (n, 3)
        y after each cycle (g).
    """
    _, a = _history(motion)
    return np.asarray(_play(a, band)[len(motion.past) :])


def _history(motion: Motion) -> tuple[Floats, Floats]:
    """Lengths (m + n,) in s and forces (m + n, 3) in g of all cycles, those before the first one too."""
    if not len(motion.past):
        return motion.dt, motion.a
    dt = np.concatenate([motion.past[:, 0], motion.dt])
    return dt, np.vstack([motion.past[:, 1:] / STANDARD_GRAVITY, motion.a])


@compiled
def _low_pass(dt: Floats, a: Floats, tau: float) -> Floats:
    out = np.empty(a.shape)
    for i in range(a.shape[1]):
        y = a[0, i]
        for k in range(a.shape[0]):
            share = dt[k] / tau
            gone = -np.expm1(-share)
            out[k, i] = a[k, i] + (y - a[k, i]) * gone / share
            y += (a[k, i] - y) * gone
    return out


@compiled
def _play(a: Floats, band: float) -> Floats:
    out = np.empty(a.shape)
    for i in range(a.shape[1]):
        y = a[0, i]
        for k in range(a.shape[0]):
            y = min(max(y, a[k, i] - band), a[k, i] + band)
            out[k, i] = y
    return out
