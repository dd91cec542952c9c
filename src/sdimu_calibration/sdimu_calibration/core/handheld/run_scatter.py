"""What a run by hand scatters by beyond its white noise, and how that is learned from what a least squares leaves over.

What is more than white noise is not specified by anybody for a cheap IMU in a hand, so three sigmas are learned: of the
forces at rest, of the rates at rest, of the turns as a share of their angle. Each is as large as makes the squared
residuals of its equations as many as their redundancy (the moment estimate of Paule & Mandel, J. Res. NBS 87, 1982;
for least squares, Koch, *Parameter Estimation and Hypothesis Testing in Linear Models*, section 3.6).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sdimu_calibration.core.arrays import Bools, Floats, Ints
from sdimu_calibration.core.handheld.handheld_data import HandheldRun
from sdimu_calibration.core.units import from_si
from sdimu_calibration.core.variances import crossing

FORCE, RATE, TURN, WHOLE, PRIOR = 0, 1, 2, 3, -1
"""The kinds of equation; the scatter of the first three is learned, that of whole turns is stated, priors are whitened
already."""
_HEADING_STEP = 1e-3
"""Sigma of a step of a heading that nothing tells (rad): small enough to hold it, large enough to invert."""


@dataclass(frozen=True)
class RunScatter:
    """How the variance of each equation of a run follows from white noise and the learned sigmas."""

    kind: Ints
    """One of `FORCE`, `RATE`, `TURN`, `WHOLE`, `PRIOR`, shape (m,)."""
    white: Floats
    """Variance by white noise, sway and gaps, in the squared unit of the residual (SI), shape (m,)."""
    by: Floats
    """Variance per squared learned sigma of force, rate and turn, shape (m, 3)."""
    unseen: Bools
    """Equations of turns that say nothing, shape (m,)."""

    @property
    def measured(self) -> Bools:
        """Equations that are measurements and say something, shape (m,)."""
        return np.asarray((self.kind != PRIOR) & ~self.unseen)

    def sigmas(self, extra: Floats) -> Floats:
        """Sigma of every equation.

        Parameters
        ----------
        extra : ndarray, shape (3,)
            Learned sigmas of force (m/s^2), rate (rad/s) and turn (rad per rad of way).

        Returns
        -------
        ndarray, shape (m,)
            In the unit of its residual (SI).
        """
        return np.asarray(np.sqrt(self.white + self.by @ extra**2))

    def of(self, rows: Ints) -> RunScatter:
        """Take some of the equations.

        Parameters
        ----------
        rows : ndarray of int, shape (n,)
            Their places.
        """
        return RunScatter(self.kind[rows], self.white[rows], self.by[rows], self.unseen[rows])

    def sigmas_of_step(self, extra: Floats) -> Floats:
        """Sigmas for a step of a search: a heading after a turn that nobody saw stays where it is.

        The Earth tells it so badly that no search for it ends, and what it is wrong by is learned as scatter of the
        rates.

        Parameters
        ----------
        extra : ndarray, shape (3,)
            As of `sigmas`.

        Returns
        -------
        ndarray, shape (m,)
            SI.
        """
        return np.where(self.unseen, _HEADING_STEP, self.sigmas(extra))


def run_scatter(run: HandheldRun, gyro_white_noise: float, accel_white_noise: float, priors: int) -> RunScatter:
    """Make the variances of the equations of a run, in the order of `handheld_fit.equations`.

    Parameters
    ----------
    gyro_white_noise, accel_white_noise : float
        Densities (rad/s/sqrt(Hz), m/s^2/sqrt(Hz)).
    priors : int
        Number of equations of priors behind the others.
    """
    k, w = len(run.t), len(run.whole)
    angle, speed = run.sway.angle**2, run.sway.speed**2
    # What a rest begins with and what it ends with are two draws of its sway, and a turn begins and ends with one.
    rate = gyro_white_noise**2 / run.seconds + 2.0 * angle / run.seconds**2
    force = accel_white_noise**2 / run.seconds + 2.0 * speed / run.seconds**2
    turn = gyro_white_noise**2 * run.turn_s + run.gap**2 + angle[:-1] + angle[1:]
    kind = np.concatenate(
        [np.tile([RATE] * 3 + [FORCE] * 3, k), np.full(3 * (k - 1), TURN), np.full(w, WHOLE), np.full(priors, PRIOR)]
    )
    white = np.ones(len(kind))
    white[: 6 * k] = np.stack([rate, rate, rate, force, force, force], axis=1).ravel()
    white[6 * k : 9 * k - 3] = np.repeat(turn, 3)
    white[kind == WHOLE] = run.whole_sigma**2
    by = np.zeros((len(kind), 3))
    by[kind == FORCE, FORCE] = 1.0
    by[kind == RATE, RATE] = 1.0
    # A bias that wanders turns the IMU all the way.
    by[kind == TURN, RATE] = np.repeat(run.turn_s**2, 3)
    by[kind == TURN, TURN] = np.repeat(run.path**2, 3)
    unseen = np.zeros(len(kind), dtype=bool)
    unseen[6 * k : 9 * k - 3] = np.repeat(run.unseen, 3)
    return RunScatter(kind, white, by, unseen)


def stacked_scatters(scatters: Sequence[RunScatter]) -> RunScatter:
    """Put the equations of several runs one below the other."""
    return RunScatter(
        np.concatenate([s.kind for s in scatters]),
        np.concatenate([s.white for s in scatters]),
        np.vstack([s.by for s in scatters]),
        np.concatenate([s.unseen for s in scatters]),
    )


def learned(scatter: RunScatter, extra: Floats, left: Floats, free: Floats) -> Floats:
    """Learn the sigmas beyond white noise from what a least squares leaves over.

    Each is searched with the redundancies of the present weights; the least squares repeats it until both stand.

    Parameters
    ----------
    extra : ndarray, shape (3,)
        Present ones, as of `RunScatter.sigmas`.
    left : ndarray, shape (m,)
        Residuals of the equations (SI).
    free : ndarray, shape (m,)
        Redundancy of each equation (1).

    Returns
    -------
    ndarray, shape (3,)
        As `extra`.
    """
    out = extra.copy()
    for which in (FORCE, RATE, TURN):
        mine = (scatter.kind == which) & ~scatter.unseen
        if not mine.any():
            continue
        white, by, squares = scatter.white[mine], scatter.by[mine], left[mine] ** 2
        rest = white + np.delete(by, which, axis=1) @ np.delete(out, which) ** 2

        def excess(
            value: float,
            squares: Floats = squares,
            rest: Floats = rest,
            own: Floats = by[:, which],
            target: float = float(free[mine].sum()),
        ) -> float:
            return float(np.sum(squares / (rest + own * value**2))) - target

        out[which] = crossing(excess, float(np.sqrt(np.mean(squares))))
    return out


def scatter_in_words(extra: Sequence[float]) -> str:
    """Write learned sigmas of force (m/s^2), rate (rad/s) and turn (share of the angle) for people."""
    force, rate, turn = (extra[which] for which in (FORCE, RATE, TURN))
    share = 100.0 * turn
    return f"force {from_si(force, 'ug'):.3g} ug, rate {np.degrees(rate):.2g} deg/s, turns {share:.2g} % of the angle"
