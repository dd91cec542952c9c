"""How noise that is not white correlates over the stretches of a test: random walk, flicker, Markov, drawn anew.

A stretch is a part of a dwell or of a turn, over which the wandering bias of a sensor is taken as its mean. Each term
has one size; its covariance over the stretches is the square of the size times a kernel.

Sources: IEEE Std 952-1997, annex C (random walk, flicker, Markov noise); K. Keshner, "1/f noise", Proc. IEEE 70 (1982)
(flicker as a sum of Markov terms whose time constants are in geometric progression).
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from sdimu_calibration.core.arrays import Bools, Floats, Ints
from sdimu_calibration.core.effects.effect import CHANNELS, Effect, Parameter, Term, Timetable
from sdimu_calibration.core.effects.motion import Motion
from sdimu_calibration.core.evidence.attitude_functions import AttitudeFunctions
from sdimu_calibration.core.evidence.conditions import Conditions
from sdimu_calibration.core.noise_term import ATTITUDE, FLICKER, FOLLOWS, MARKOV, RANDOM_WALK, SHIFT, TURN

_LONGEST_S = 30.0
"""Longest stretch (s): flicker of data-sheet size moves within it by less than a tenth of the variance of white noise
in dtg, fog_tactical and rlg_navigation; for others `stretch_length` halves it."""
_FEWEST = 8
"""Number of stretches (1) at least: the mean of one is the bias, and noise that moves within a rest of 20 s, the whole
recording, was taken for a warm-up."""
_MOST = 100
"""Number of stretches at most: longer tests have longer ones, and the time of an estimate goes with the cube."""
_KEPT = 1e-9
"""Share of the largest eigenvalue of a kernel below which a mode is left out: it is rounding. A larger share makes
random walk and flicker smoother than they are, and Gauss-Markov noise is named in their place."""
_RATIO = 4.0
"""Ratio of neighbouring time constants of flicker noise: the density then ripples by 2 %."""
_SHORTEST_TAU_S = 0.5
"""Shortest time constant of flicker noise (s): what is faster is white noise in the mean of a second, the shortest that
is measured. Without those below two seconds, flicker above white noise left a tenth of the variance."""


@dataclass(frozen=True)
class Stretches:
    """Stretches of a test, n of them, in the order of time; m functions of the attitude may stand behind them.

    A cell is a stretch with a constant error, or a function of the attitude with its weight.
    """

    start: Floats
    end: Floats
    """`start`, `end`: s, shape (n,)."""
    interval: Ints
    """Number of the dwell or turn that a stretch is part of, shape (n,)."""
    turning: Bools
    """Shape (n,)."""
    conditions: Conditions | None = None
    """What an unknown error may follow; None where nobody knows it."""
    functions: AttitudeFunctions | None = None
    """m of them, which make up an unknown function of the attitude; None where that is taken as its mean over each
    stretch."""
    _modes: dict[tuple[str, float], Floats] = field(default_factory=dict, repr=False, compare=False)

    def __len__(self) -> int:
        """Return the number of stretches."""
        return len(self.start)

    @property
    def cells(self) -> int:
        """Number of cells, n + m."""
        return len(self) + (0 if self.functions is None else len(self.functions))

    @property
    def in_dwells(self) -> Floats:
        """Mean over all dwells of a unit error in each cell; of a function zero, as it is no part of the bias.

        Returns
        -------
        ndarray, shape (n + m,)
            Share of the time of all dwells (1).
        """
        share = np.where(self.turning, 0.0, self.end - self.start)
        return np.concatenate([share / share.sum(), np.zeros(self.cells - len(self))])

    def at_stretches(self, kind: str) -> Floats:
        """Mean over each stretch of a unit error in each cell, as far as it follows what a kind of noise does.

        Returns
        -------
        ndarray, shape (n, n + m)
            (1).
        """
        n = len(self)
        if kind == ATTITUDE and self.functions is not None and self.conditions is not None:
            return np.hstack([np.zeros((n, n)), self.functions.at(self.conditions.force)])
        return np.eye(n, self.cells)

    def mode(self, kind: str, tau: float) -> Floats:
        """Square root R of the kernel of a kind of noise, ``kernel = RR'`` but for its small modes.

        Parameters
        ----------
        kind : str
            One of `KINDS`.
        tau : float
            Time constant of Markov noise (s).

        Returns
        -------
        ndarray, shape (n + m, r)
            In the root of the unit of `kernel`.
        """
        if (kind, tau) not in self._modes:
            self._modes[kind, tau] = self._root(kind, tau)
        return self._modes[kind, tau]

    def _root(self, kind: str, tau: float) -> Floats:
        n, m = len(self), self.cells - len(self)
        if kind == ATTITUDE and m:
            return np.vstack([np.zeros((n, m)), np.eye(m)])
        values, vectors = np.linalg.eigh(kernel(kind, tau, self))
        keep = values > _KEPT * values[-1]
        return np.vstack([vectors[:, keep] * np.sqrt(values[keep]), np.zeros((m, int(keep.sum())))])


def stretches(times: Timetable, share: float = 1.0) -> Stretches:
    """Cut the dwells and turns of a test into stretches.

    Parameters
    ----------
    share : float
        Ratio of their length to the usual one.
    """
    longest = share * min(max(_LONGEST_S, times.duration / _MOST), times.duration / _FEWEST)
    spans = sorted([(a, b, False) for _, a, b in times.stops] + [(a, b, True) for _, a, b in times.turns])
    rows: list[tuple[float, float, int, bool]] = []
    for number, (begin, end, turning) in enumerate(spans):
        edges = np.linspace(begin, end, max(1, int(np.ceil((end - begin) / longest - 1e-9))) + 1)
        rows += [(a, b, number, turning) for a, b in zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True)]
    start, end_, interval, turns = zip(*rows, strict=True)
    return Stretches(np.array(start), np.array(end_), np.array(interval, dtype=np.int64), np.array(turns))


def stretch_effects(cut: Stretches) -> list[Effect]:
    """Give every sensor a constant error of its own in every stretch; one effect a stretch, six parameters each."""
    spans = zip(cut.start.tolist(), cut.end.tolist(), strict=True)
    return [constant_between(f"{a:.1f} to {b:.1f} s", a, b) for a, b in spans]


def constant_between(label: str, begin: float, end: float) -> Effect:
    """Give every sensor a constant error of its own from `begin` to `end` (s); six parameters."""

    def share(motion: Motion) -> Floats:
        overlap = np.minimum(motion.t, end) - np.maximum(motion.t - motion.dt, begin)
        return np.asarray(np.clip(overlap / motion.dt, 0.0, 1.0)[:, None].repeat(6, axis=1))

    return Effect(
        name=label,
        title=label,
        equation="constant in this stretch",
        parameters=tuple(
            Parameter(f"{c} in {label}", "rad/s" if i < 3 else "m/s^2", "deg/h" if i < 3 else "ug")
            for i, c in enumerate(CHANNELS)
        ),
        terms=tuple(Term(i, i) for i in range(6)),
        regressors=share,
        prior={},
    )


def kernel(kind: str, tau: float, cut: Stretches) -> Floats:
    """Covariance of the mean of a kind of noise over the stretches, for a size of one.

    Parameters
    ----------
    kind : str
        One of `KINDS`.
    tau : float
        Time constant of Markov noise (s).

    Returns
    -------
    ndarray, shape (n, n)
        A pure number; for a random walk in s.
    """
    if kind == RANDOM_WALK:
        return _walk(cut.start, cut.end)
    if kind == MARKOV:
        return _markov(cut.start, cut.end, tau)
    if kind == FLICKER:
        # Density B^2/(2 pi f), of both signs of f: a Markov term of every time constant, variance B^2 ln(ratio)/pi.
        longest = 10.0 * float(cut.end[-1])
        count = int(np.ceil(np.log(longest / _SHORTEST_TAU_S) / np.log(_RATIO))) + 1
        parts = [_markov(cut.start, cut.end, _SHORTEST_TAU_S * _RATIO**k) for k in range(count)]
        return np.asarray(np.log(_RATIO) / np.pi * np.sum(parts, axis=0))
    if kind == SHIFT:
        begun = cut.turning & ~np.concatenate([[False], cut.turning[:-1]])
        passed = np.cumsum(begun.astype(float))
        passed = passed - 0.5 * cut.turning
        return np.asarray(np.minimum.outer(passed, passed))
    if kind in FOLLOWS:
        # Where nobody knows what it follows, that is one in all stretches.
        return np.ones((len(cut), len(cut))) if cut.conditions is None else cut.conditions.kernel(kind)
    of_kind = cut.turning if kind == TURN else ~cut.turning
    same = cut.interval[:, None] == cut.interval[None, :]
    return np.asarray((same & of_kind[:, None]).astype(np.float64))


def _walk(start: Floats, end: Floats) -> Floats:
    """Covariance (n, n) of the means of a random walk of unit density that is zero at t = 0 (s).

    Of two stretches it is the middle of the earlier one, of one with itself its start and a third of its length.
    """
    middle = 0.5 * (start + end)
    out = np.minimum.outer(middle, middle)
    np.fill_diagonal(out, start + (end - start) / 3.0)
    return np.asarray(out)


def _markov(start: Floats, end: Floats, tau: float) -> Floats:
    """Covariance (n, n) of the means of first-order Markov noise of unit variance: integrals of ``exp(-|t| / tau)``."""
    x = (end - start) / tau
    share = -np.expm1(-x) / x
    gap = np.maximum(start[None, :] - end[:, None], start[:, None] - end[None, :]) / tau
    out = np.exp(-np.maximum(gap, 0.0)) * np.outer(share, share)
    np.fill_diagonal(out, 2.0 * (1.0 - share) / x)
    return np.asarray(out)
