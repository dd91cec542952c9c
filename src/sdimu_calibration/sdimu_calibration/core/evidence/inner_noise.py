"""Noise with a memory as it moves within stretches: what their means leave of it.

Where flicker is above white noise from a second on, a bias moves within a stretch of half a minute by many sigmas of
the stretch's mean, and stretches of a second are too many. In each stretch at rest the noise is a sum of cosines

    n(t) = mean + sum of c_k cos(pi k (t - a) / L),   k = 1 ... K

The c_k have the covariance that the kernel of the noise gives them. A cosine has no mean: it turns the sensors by
nothing from one stretch to the next, its signature stays in the rows of its stretch, and these are whitened by
themselves.

Source: N. Ahmed, T. Natarajan, K. Rao, "Discrete cosine transform", IEEE Trans. Computers C-23 (1974) (nearly the
principal components of noise with a memory).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.effects.effect import CHANNELS, Effect, Parameter, Term
from sdimu_calibration.core.effects.motion import Motion
from sdimu_calibration.core.evidence.noise_kernels import Stretches, kernel
from sdimu_calibration.core.noise_term import FLICKER, MARKOV, RANDOM_WALK, TRIADS, NoiseTerm
from sdimu_calibration.core.side_by_side import side_by_side

_COSINES = 16
"""Number of cosines of a stretch: the variance of flicker falls with 1/k, beyond the sixteenth to a twentieth of the
first."""
_PIECES = 128
"""Number of pieces of a stretch over which cosines are integrated: eight for each wave of the fastest."""
_MOVING = (RANDOM_WALK, FLICKER, MARKOV)
"""Kinds of noise that move within a stretch."""

Signature = Callable[[Sequence[Effect]], Floats]
"""Gives the signatures of all parameters of some effects."""


@dataclass(frozen=True)
class _Part:
    """Rows of a stretch, orthogonal directions of the noise in them, and the share of each that whitening takes."""

    rows: slice
    directions: Floats
    share: Floats


@dataclass(frozen=True)
class InnerNoise:
    """Whitens rows in noise that moves within stretches."""

    parts: tuple[_Part, ...]
    terms: tuple[NoiseTerm, ...] = ()
    """The noise, with its sizes."""

    def whitened(self, columns: Floats) -> Floats:
        """Multiply with ``(I + V C V')^-1/2``, V the signatures of the cosines and C their covariance.

        Parameters
        ----------
        columns : ndarray, shape (N,) or (N, k)
            In white noise.

        Returns
        -------
        ndarray, shape (N,) or (N, k)
            In the same units.
        """
        out = columns.copy(order="K")

        def whiten(part: _Part) -> None:
            Q = part.directions
            share = part.share if columns.ndim == 1 else part.share[:, None]
            out[part.rows] -= Q @ (share * (Q.T @ columns[part.rows]))

        side_by_side(whiten, self.parts)
        return out


def inner_noise(t: Floats, signature: Signature, cut: Stretches, terms: Sequence[NoiseTerm]) -> InnerNoise:
    """Work out how noise moves within the stretches of a test.

    Parameters
    ----------
    t : ndarray, shape (N,)
        Time at the end of what each row measures (s), not decreasing.
    signature : callable
        Effects to the signatures of their parameters, shape (N, parameters), in white noise.
    terms : sequence of NoiseTerm
        With their sizes.
    """
    moving = [term for term in terms if term.kind in _MOVING]
    V = signature([_cosine(k, cut) for k in range(1, _COSINES + 1)]).reshape(len(t), _COSINES, len(CHANNELS))
    parts = []
    roots: dict[tuple[str, float], Floats] = {}
    for begin, end, turning in zip(cut.start.tolist(), cut.end.tolist(), cut.turning.tolist(), strict=True):
        rows = slice(*np.searchsorted(t, (begin, end), side="right").tolist())
        if turning or rows.start == rows.stop:
            continue
        length = round(end - begin, 6)
        for triad in TRIADS:
            if (triad, length) not in roots:
                roots[triad, length] = _root(moving, triad, length, float(cut.end[-1]))
        modes = [V[rows, :, channel] @ roots[TRIADS[channel // 3], length] for channel in range(len(CHANNELS))]
        U, size, _ = np.linalg.svd(np.hstack(modes), full_matrices=False)
        parts.append(_Part(rows, np.ascontiguousarray(U), 1.0 - 1.0 / np.sqrt(1.0 + size**2)))
    return InnerNoise(tuple(parts), tuple(terms))


def _cosine(k: int, cut: Stretches) -> Effect:
    """Give every sensor the error ``cos(pi k (t - a) / L)`` in every stretch at rest; six parameters."""
    start, end = cut.start[~cut.turning], cut.end[~cut.turning]

    def share(motion: Motion) -> Floats:
        middle = motion.t - 0.5 * motion.dt
        place = np.clip(np.searchsorted(start, middle, side="right") - 1, 0, len(start) - 1)
        within = (middle >= start[place]) & (middle <= end[place])
        wave = np.cos(np.pi * k * (middle - start[place]) / (end[place] - start[place]))
        return np.asarray(np.where(within, wave, 0.0)[:, None].repeat(len(CHANNELS), axis=1))

    units = [("rad/s", "deg/h") if i < 3 else ("m/s^2", "ug") for i in range(len(CHANNELS))]
    return Effect(
        name=f"cosine {k}",
        title=f"cosine {k} of every stretch",
        equation="cos(pi k (t - a) / L) from a to a + L",
        parameters=tuple(Parameter(f"{c} cosine {k}", *unit) for c, unit in zip(CHANNELS, units, strict=True)),
        terms=tuple(Term(i, i) for i in range(len(CHANNELS))),
        regressors=share,
        prior={},
    )


def _root(terms: Sequence[NoiseTerm], triad: str, length: float, duration: float) -> Floats:
    """Square root of the covariance of the cosines of a sensor in a stretch, shape (K, r).

    Parameters
    ----------
    length, duration : float
        Of the stretch and of the test (s).
    """
    own = [term for term in terms if term.triad == triad]
    if not own:
        return np.zeros((_COSINES, 0))
    edges = np.linspace(0.0, length, _PIECES + 1)
    # A last piece at the end of the test: the slowest flicker is that of the whole.
    start, end = (
        np.append(edges[:-1], max(duration - length, length)),
        np.append(edges[1:], max(duration, 2.0 * length)),
    )
    zero = np.zeros(_PIECES + 1, dtype=np.int64)
    pieces = Stretches(start, end, zero, zero.astype(bool))
    covariance = np.sum([term.size**2 * kernel(term.kind, term.tau, pieces)[:-1, :-1] for term in own], axis=0)
    middle = (edges[:-1] + edges[1:]) / (2.0 * length)
    wave = np.cos(np.pi * np.arange(1, _COSINES + 1)[:, None] * middle)
    values, vectors = np.linalg.eigh((2.0 / _PIECES) ** 2 * wave @ covariance @ wave.T)
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0)))
