"""The loop of passes, whatever they linearise: each about where the one before ended, until nothing moves."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from sdimu_calibration.core.alignment.coarse_alignment import StartPoint
from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.filter.filter_pass import COPY, NAV, PassInput, PassOutput, PassState
from sdimu_calibration.core.progress import Progress
from sdimu_calibration.core.rotation import rotation_matrix

CONVERGED = 0.02
"""Largest movement of a coefficient (sigma) at which the passes end: smaller ones change no report."""


@dataclass(frozen=True)
class FinishedPass(ABC):
    """A finished pass: where it was linearised, where it ended."""

    C_start: Floats
    """Initial attitude about which it was linearised, b to n (dimensionless), shape (3, 3)."""
    start: PassState
    state: PassState
    """`start`, `state`: at the first sample, and after the last epoch."""
    output: PassOutput
    """One row an epoch."""
    data: PassInput

    @property
    @abstractmethod
    def about(self) -> Floats:
        """Coefficients (SI) from which the state counts, shape (p,)."""

    @property
    def smoothed_start(self) -> Floats:
        """Initial attitude as the whole test sees it, shape (3, 3)."""
        return np.asarray(rotation_matrix(self.state.x[-COPY:].copy()) @ self.C_start)

    @property
    def estimate(self) -> Floats:
        """Coefficients at the end (SI), shape (p,)."""
        return np.asarray(self.about + self.state.x[NAV : NAV + len(self.about)])

    @property
    def covariance(self) -> Floats:
        """Covariance of `estimate` (SI), shape (p, p)."""
        p = len(self.about)
        return np.asarray(self.state.P[NAV : NAV + p, NAV : NAV + p])


AnyPass = TypeVar("AnyPass", bound=FinishedPass)


@dataclass(frozen=True)
class Ending:
    """When passes hold on to position and velocity, and when they end."""

    most: int
    """Number of passes at most."""
    settled: float
    """Movement of a coefficient (sigma) from which position and velocity are taken in."""
    most_loose: int
    """Number of the last pass after which another one may be made without them; then they are taken in whatever moves.
    """
    least: int
    """Number of passes with both at least."""
    near: float
    """Movement (sigma) up to which passes that ran out have converged."""


def until_nothing_moves(
    run: Callable[[StartPoint, AnyPass | None, bool], AnyPass],
    begin: StartPoint,
    loose: bool,
    ending: Ending,
    progress: Progress,
) -> tuple[AnyPass, int, bool]:
    """Repeat passes, each about where the one before ended, until the coefficients stand still.

    Parameters
    ----------
    run : callable
        Makes a pass about a point, from the pass before where there is one, without position and velocity or with.
    loose : bool
        Begin without position and velocity.

    Returns
    -------
    last : FinishedPass
    passes : int
    converged : bool
    """
    at, last, tight = begin, None, 0
    for count in range(1, ending.most + 1):
        progress("passes", min(0.95, 0.2 + 0.05 * count))
        last = run(at, last, loose)
        moved = furthest_move(last.estimate - at.coefficients, last.covariance)
        at = StartPoint(last.smoothed_start, last.estimate)
        if loose:
            loose = moved >= ending.settled and count <= ending.most_loose
            continue
        tight += 1
        if tight >= ending.least and moved < CONVERGED:
            return last, count, True
    assert last is not None
    return last, ending.most, moved < ending.near


def furthest_move(step: Floats, covariance: Floats) -> float:
    """Largest step of a coefficient that is not known.

    Parameters
    ----------
    step : ndarray, shape (p,)
        SI.
    covariance : ndarray, shape (p, p)
        SI; zero where a coefficient is known.

    Returns
    -------
    float
        In units of its sigma (1).
    """
    sigma = np.sqrt(np.diag(covariance))
    free = sigma > 0.0
    return float(np.max(np.abs(step[free]) / sigma[free], initial=0.0))
