"""How long the stretches may be over which a wandering bias is taken as its mean.

A bias that moves within a stretch as much as its white noise does is not described by its mean: the search then names
steps and sines for what moves within, and the sigmas are too small. There stretches are halved, once: a quarter of the
length takes three times as long. Where a bias moves that much in half a stretch, too, all rows are whitened in what
moves within (`inner_noise`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.evidence.inner_noise import inner_noise
from sdimu_calibration.core.evidence.linear import LinearEvidence
from sdimu_calibration.core.evidence.noise_kernels import Stretches, kernel
from sdimu_calibration.core.evidence.wander import Wander
from sdimu_calibration.core.noise_term import TRIADS, NoiseTerm

MOVES = 0.5
"""Ratio of the variance between the halves of a stretch to that of white noise, from which the stretch is halved: half
as much changes a sigma by a fifth."""
_OTHER = 2.0
"""Ratio of the variance that moves within a stretch to that in which rows are whitened (1) from which that is done
anew: the 95 % interval of a size is as wide."""


def held(wander: Wander, terms: Sequence[NoiseTerm]) -> bool:
    """Tell whether stretches, with the noise that rows are whitened in, hold noise as it moves within them."""
    moves = moves_within(wander, terms)
    known = 0.0 if wander.inner is None else moves_within(wander, wander.inner.terms)
    if moves < MOVES or known < MOVES:
        return moves < MOVES and known < MOVES
    return 1.0 / _OTHER < moves / known < _OTHER


def wander_in(evidence: LinearEvidence, terms: Sequence[NoiseTerm]) -> Wander:
    """Work out how wandering biases show in a test, in stretches short enough for noise that is known.

    Parameters
    ----------
    evidence : LinearEvidence
        In white noise.
    """
    return halved(evidence, Wander.of(evidence), terms)


def halved(evidence: LinearEvidence, wander: Wander, terms: Sequence[NoiseTerm]) -> Wander:
    """Halve stretches in which noise moves too much, and whiten rows in what moves within the halves.

    Parameters
    ----------
    evidence : LinearEvidence
        In white noise.
    wander : Wander
        Of the test, in stretches of the usual length.
    terms : sequence of NoiseTerm
        The noise.
    """
    if moves_within(wander, terms) < MOVES:
        return wander
    half = Wander.of(evidence, 0.5)
    t = evidence.row_times
    if t is None or moves_within(half, terms) < MOVES:
        return half
    inner = inner_noise(t, evidence.signature, half.cut, terms)
    return replace(half, U=half.U.whitened(inner), inner=inner, plain=half)


def moves_within(wander: Wander, terms: Sequence[NoiseTerm]) -> float:
    """Ratio of the variance between the halves of a stretch at rest to that which white noise gives it.

    Returns
    -------
    float
        Of the triad that moves most; 0 without terms, and without rests.
    """
    cut = wander.cut
    if cut.turning.all():
        return 0.0
    length = float(np.median((cut.end - cut.start)[~cut.turning]))
    edges = np.array([0.0, 0.5, 1.0]) * length
    halves = Stretches(edges[:2], edges[1:], np.zeros(2, dtype=np.int64), np.zeros(2, dtype=bool))
    ratios = []
    for triad, seen in zip(TRIADS, wander.halves.reshape(2, 3), strict=True):
        moved = sum(t.size**2 * _between(kernel(t.kind, t.tau, halves)) for t in terms if t.triad == triad)
        ratios.append(moved * float(np.median(seen)))
    return max(ratios)


def _between(covariance: Floats) -> float:
    return float(covariance[0, 0] + covariance[1, 1] - 2.0 * covariance[0, 1])
