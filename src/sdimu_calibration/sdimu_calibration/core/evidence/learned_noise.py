"""Likelihood of noise with a memory in a linear model of a recording.

Every sensor gets an unknown mean error in every stretch of the test; their signatures U stand in the whitened
residuals like those of any parameter. A noise term says how these errors correlate (`noise_kernels`), so that

    e = X theta + U u + white noise,   u ~ N(0, K),   K = sum of size^2 kernel

With the coefficients theta estimated along (they are taken out by a Schur complement first), the log-likelihood of
the sizes is the restricted one:

    L = -1/2 log det(I + R'AR) + 1/2 (R'b)' (I + R'AR)^-1 R'b,   K = RR',

A and b the information on u when theta is estimated with it. Source: H. Patterson, R. Thompson, "Recovery of
inter-block information when block sizes are unequal", Biometrika 58 (1971).
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.evidence.noise_kernels import Stretches
from sdimu_calibration.core.evidence.noise_root import Root, folded, in_modes, spread_in_triad, times, triad_roots
from sdimu_calibration.core.evidence.taken import Taken, taken
from sdimu_calibration.core.evidence.testable import INDISTINGUISHABLE
from sdimu_calibration.core.evidence.tridiagonal import Tridiagonal
from sdimu_calibration.core.noise_term import (
    AXES,
    FLICKER,
    KINDS,
    MARKOV,
    RANDOM_WALK,
    SHIFT,
    STOP,
    TRIADS,
    TURN,
    NoiseTerm,
)
from sdimu_calibration.core.side_by_side import side_by_side
from sdimu_calibration.core.variances import FALL

_TIMES = tuple(1.25**k for k in range(-4, 5) if k)
"""Ratios of time constants near one that was found to it: to its neighbours, and a fifth beyond."""
MOST_TERMS = 2
"""Number of noise terms of a triad at most: a test of an hour tells no more apart."""
_GRID = np.logspace(-3.0, 8.0, 111)
"""Ratios of the variance to that at which the best seen mode is as large as its noise: no size lies outside."""
_FINE = np.logspace(-0.12, 0.12, 49)
"""Factors about the best variance of the grid: a hundredth of the width of its likelihood."""
_SHORTEST_TAU = 0.2
"""Ratio of the shortest time constant that is tried to a stretch: faster noise is white from stretch to stretch."""
TAU_RATIO = 2.0
"""Ratio (1) of neighbouring time constants that are tried, up to a third of the test: less than their interval."""


@dataclass(frozen=True)
class NoiseInformation:
    """Information on the mean errors in all stretches, the known parameters estimated along."""

    J: Floats
    """Shape (6 n, 6 n)."""
    d: Floats
    """Shape (6 n,)."""
    _beside: dict[str, tuple[Hashable, InTriad]] = field(default_factory=dict, init=False, repr=False, compare=False)
    """Of each triad, what was asked for last: beside which noise of the other triad, and the answer."""

    def block(self, row: str, column: str) -> Floats:
        """Cut out the information across two triads, axis by stretch.

        Returns
        -------
        ndarray, shape (3 n, 3 n)
            Inverse squares of the units (SI) of the errors.
        """
        n = len(self.d) // 6
        a, b = 3 * TRIADS.index(row), 3 * TRIADS.index(column)
        cut = self.J.reshape(n, 6, n, 6)[:, a : a + 3, :, b : b + 3].transpose(1, 0, 3, 2)
        return np.ascontiguousarray(cut).reshape(3 * n, 3 * n)

    def part(self, triad: str) -> Floats:
        """Cut out the information vector of a triad, axis by stretch.

        Returns
        -------
        ndarray, shape (3 n,)
            Inverse units (SI) of the errors.
        """
        first = 3 * TRIADS.index(triad)
        return np.ascontiguousarray(self.d.reshape(-1, 6)[:, first : first + 3].T).ravel()

    def gain(self, terms: Sequence[NoiseTerm], cut: Stretches) -> float:
        """Log-likelihood (1) of noise terms over that of white noise."""
        if not terms:
            return 0.0
        M, y, _ = folded(self.J, self.d, terms, cut)
        return taken(M, y, np.zeros((0, len(y)))).gain

    def of_triad(self, triad: str, terms: Sequence[NoiseTerm], cut: Stretches) -> InTriad:
        """Information on the wander of a triad, that of some terms in the model.

        Parameters
        ----------
        terms : sequence of NoiseTerm
            With their sizes.
        """
        other = TRIADS[1 - TRIADS.index(triad)]
        others = [t for t in terms if t.triad == other]
        key = tuple((t.identity, t.size) for t in others)
        if triad not in self._beside or self._beside[triad][0] != key:
            alone = InTriad(self.block(triad, triad), self.part(triad))
            roots = triad_roots(others, cut, other)
            if roots:
                across = spread_in_triad(self.block(triad, other), roots)
                alone = alone.less(taken(*in_modes(self.block(other, other), self.part(other), roots)[:2], across))
            self._beside[triad] = key, alone
        return self._beside[triad][1].beside(triad_roots(terms, cut, triad))


@dataclass(frozen=True)
class InTriad:
    """Information on the wander of a triad of sensors in n cells, axis by cell."""

    J: Floats
    """In inverse squares of the units (SI) of the errors, shape (3 n, 3 n)."""
    d: Floats
    """In inverse units, shape (3 n,)."""
    gain: float = 0.0
    """Log-likelihood (1) of the noise that is in the model, over that of white noise."""

    def beside(self, roots: Sequence[Root]) -> InTriad:
        """Put noise of the triad itself into the model."""
        return self.less(taken(*in_modes(self.J, self.d, roots))) if roots else self

    def less(self, taken: Taken) -> InTriad:
        """Leave out what modes take."""
        return InTriad(self.J - taken.J, self.d - taken.d, self.gain + taken.gain)


def with_intervals(information: NoiseInformation, cut: Stretches, terms: Sequence[NoiseTerm]) -> tuple[NoiseTerm, ...]:
    """Put 95 % intervals to the sizes of terms, and say of each which kinds in its place are as likely.

    The interval of a Markov term holds the sizes at all likely time constants near its own. Kinds are as likely within
    odds of 20 to 1. The sizes stay.
    """
    out = []
    for term in terms:
        given = information.of_triad(term.triad, [t for t in terms if t is not term], cut)
        taus = [float(f"{term.tau * k:.3g}") for k in _TIMES if term.tau]
        others = [t for t in kinds(cut) if t.triad == term.triad and t.kind != term.kind]
        sized = _best_sizes(given, cut, [term, *(replace(term, tau=tau) for tau in taus), *others])
        gain, near = sized[0].gain, sized[: 1 + len(taus)]
        likely = [t for t in near if t.gain > max(t.gain for t in near) - FALL]
        low, high = min(term.size, *(t.low for t in likely)), max(term.size, *(t.high for t in likely))
        alike = {t.kind for t in sized[len(near) :] if t.gain > gain - INDISTINGUISHABLE}
        in_order = tuple(kind for kind in KINDS if kind in alike)
        out.append(replace(term, low=low, high=high, gain=gain, alike=in_order))
    return tuple(out)


def kinds(cut: Stretches) -> list[NoiseTerm]:
    """List the terms that are tried: every kind in each triad, Markov noise with several time constants."""
    shortest = _SHORTEST_TAU * float(np.median(cut.end - cut.start))
    longest = max(float(cut.end[-1]) / 3.0, 2.0 * shortest)
    count = 1 + int(np.log(longest / shortest) / np.log(TAU_RATIO) + 1e-9)
    taus = [float(f"{longest * TAU_RATIO**-k:.3g}") for k in reversed(range(count))]
    out = []
    for triad in TRIADS:
        out += [NoiseTerm(triad, kind) for kind in (RANDOM_WALK, FLICKER, STOP, TURN, SHIFT)]
        out += [NoiseTerm(triad, MARKOV, tau) for tau in taus]
    return out


def _best_sizes(given: InTriad, cut: Stretches, terms: Sequence[NoiseTerm]) -> list[NoiseTerm]:
    """Best size of each of some terms alone."""
    return side_by_side(lambda term: _best_size(given, cut, term), terms)


def _best_size(given: InTriad, cut: Stretches, term: NoiseTerm) -> NoiseTerm:
    """Best size of a term of a triad."""
    modes = InModes.of(given, cut, term.kind, term.tau).in_sensors(term.axes)
    variance = _grid(modes)
    if not len(variance):
        return replace(term, size=0.0, low=0.0, high=0.0, gain=0.0)
    gain = modes.gain(variance)
    at = int(np.argmax(gain))
    if gain[at] <= 0.0:
        inside = np.flatnonzero(gain > -FALL)
        high = float(np.sqrt(variance[inside[-1]])) if len(inside) else 0.0
        return replace(term, size=0.0, low=0.0, high=high, gain=0.0)
    fine = variance[at] * _FINE
    near = modes.gain(fine)
    best = int(np.argmax(near))
    # Noise that stands far out is known better than the coarse grid is wide: both grids say how far its interval goes.
    order = np.argsort(np.concatenate([variance, fine]))
    both = np.concatenate([variance, fine])[order]
    inside = np.flatnonzero(np.concatenate([gain, near])[order] > near[best] - FALL)
    low = 0.0 if near[best] < FALL else float(np.sqrt(both[max(inside[0] - 1, 0)]))
    high = float(np.sqrt(both[min(inside[-1] + 1, len(both) - 1)]))
    return replace(term, size=float(np.sqrt(fine[best])), low=low, high=high, gain=float(near[best]))


@dataclass(frozen=True)
class InModes:
    """Information on the modes of a kind of noise of unit size, r of them, in each sensor of a triad."""

    J: Floats
    """Its upper half, axis by mode (1), shape (3 r, 3 r)."""
    d: Floats
    """(1), shape (3 r,)."""

    @classmethod
    def of(cls, given: InTriad, cut: Stretches, kind: str, tau: float) -> InModes:
        """Take it from the information on the wander of a triad."""
        root = cut.mode(kind, tau)
        n, r = root.shape
        J = np.zeros((len(AXES) * r, len(AXES) * r))
        for a in AXES:
            across = (root.T @ given.J[a * n : (a + 1) * n, a * n :]).reshape(-1, n)
            J[a * r : (a + 1) * r, a * r :] = (across @ root).reshape(r, (len(AXES) - a) * r)
        return cls(J, times(given.d[None], root, AXES)[0])

    def in_sensors(self, axes: Sequence[int]) -> Tridiagonal:
        """Information on the modes of some sensors alone."""
        if len(axes) == len(AXES):
            return Tridiagonal.of(self.J, self.d)
        own = np.arange(len(self.d)).reshape(len(AXES), -1)[list(axes)].ravel()
        return Tridiagonal.of(self.J[np.ix_(own, own)], self.d[own])

    def sizes_on_grid(self, axes: Sequence[int]) -> tuple[Floats, Floats]:
        """Log-likelihood of such noise in some sensors, by its size.

        Returns
        -------
        size : ndarray, shape (s,)
            SI, ascending; empty where the data say nothing of such noise.
        gain : ndarray, shape (s,)
            Log-likelihood over that without the term (1).
        """
        modes = self.in_sensors(axes)
        variance = _grid(modes)
        return np.sqrt(variance), modes.gain(variance)


def _grid(modes: Tridiagonal) -> Floats:
    """Variances of noise that are tried first (v,); empty where the data say nothing of the modes."""
    largest = modes.largest if len(modes.own) else 0.0
    return _GRID / largest if largest > 0.0 else np.empty(0)
