"""A pass, and the loop of passes: each about where the one before ended, until nothing moves."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from sdimu_calibration.core.alignment.coarse_alignment import StartPoint
from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.filter.filter_pass import COPY, NAV, PassInput, PassOutput, PassState
from sdimu_calibration.core.progress import Progress
from sdimu_calibration.core.rotation import rotation_matrix

MOST_PASSES = 30
"""Number of passes at most: where the estimate still moves then, it does not converge."""
CONVERGED = 0.02
"""Largest movement of a coefficient (sigma) at which the passes end: smaller ones change no report."""
SETTLED = 5.0
"""Movement of a coefficient (sigma) below which Zv and Zp are taken in: the azimuth has found its place. A pass leaves
the square of what was wrong (of movements of 1 to 5 sigma the next one was below 0.004, in eight tests of two IMUs)."""


@dataclass(frozen=True)
class Pass:
    """A finished pass: where it was linearised, where it ended."""

    reference: Floats
    """Coefficients (SI) at which the samples were corrected, and from which the state counts, shape (p,)."""
    C_start: Floats
    """Initial attitude about which it was linearised, b to n (dimensionless), shape (3, 3)."""
    start: PassState
    state: PassState
    """`start`, `state`: at the first sample, and after the last epoch."""
    output: PassOutput
    """One row an epoch."""
    data: PassInput

    @property
    def smoothed_start(self) -> Floats:
        """Initial attitude as the whole test sees it, shape (3, 3)."""
        return np.asarray(rotation_matrix(self.state.x[-COPY:].copy()) @ self.C_start)

    @property
    def estimate(self) -> Floats:
        """Coefficients at the end (SI), shape (p,)."""
        return np.asarray(self.reference + self.state.x[NAV : NAV + len(self.reference)])

    @property
    def covariance(self) -> Floats:
        """Covariance of `estimate` (SI), shape (p, p)."""
        p = len(self.reference)
        return np.asarray(self.state.P[NAV : NAV + p, NAV : NAV + p])


def until_nothing_moves(
    run: Callable[[StartPoint, bool], Pass], begin: StartPoint, loose: bool, progress: Progress
) -> tuple[Pass, int, bool]:
    """Repeat passes, each about where the one before ended, until the coefficients stand still.

    Position and velocity are known so well that the second order of a large error of the initial azimuth contradicts
    them, and holding on to them pins the azimuth where it is: passes from a coarse start let them go until the rest has
    found its place.

    Parameters
    ----------
    run : callable
        Makes a pass about a point, without position and velocity or with.
    loose : bool
        Begin without position and velocity.

    Returns
    -------
    last : Pass
    passes : int
    converged : bool
    """
    at = begin
    for count in range(1, MOST_PASSES + 1):
        progress("passes", min(0.95, 0.2 + 0.05 * count))
        last = run(at, loose)
        moved = furthest_move(last.estimate - at.coefficients, last.covariance)
        at = StartPoint(last.smoothed_start, last.estimate)
        if not loose and moved < CONVERGED:
            return last, count, True
        loose = loose and moved >= SETTLED
    return last, MOST_PASSES, False


def furthest_move(step: Floats, covariance: Floats) -> float:
    """Largest step of a coefficient, in its sigma (1).

    Parameters
    ----------
    step : ndarray, shape (p,)
        SI.
    covariance : ndarray, shape (p, p)
        SI; zero where a coefficient is known.
    """
    sigma = np.sqrt(np.diag(covariance))
    free = sigma > 0.0
    return float(np.max(np.abs(step[free]) / sigma[free], initial=0.0))
