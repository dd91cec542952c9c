"""Square root of the covariance of the errors that noise with a memory makes in each stretch of a test.

Each sensor of a term draws its own error from one kernel, so a root is that of one sensor (n cells by r modes) for each
of the sensors that the term is of; columns come triad by triad, of a triad mode by mode, of a mode axis by axis.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sdimu_calibration.core.arrays import Floats, Ints
from sdimu_calibration.core.evidence.noise_kernels import Stretches
from sdimu_calibration.core.noise_term import TRIADS, NoiseTerm


def root_of(terms: Sequence[NoiseTerm], cut: Stretches) -> Floats:
    """Square root R of the covariance of the mean errors, ``K = RR'``.

    Returns
    -------
    ndarray, shape (6 n, r)
        SI.
    """
    parts = []
    for first, triad in zip((0, 3), TRIADS, strict=True):
        root, own = triad_root(terms, cut, triad)
        every = np.zeros((cut.cells, 6, root.shape[1], 3))
        for axis in range(3):
            every[:, first + axis, :, axis] = root
        parts.append(every.reshape(6 * cut.cells, -1)[:, own])
    return np.hstack(parts)


def columns_of(terms: Sequence[NoiseTerm], cut: Stretches) -> list[Ints]:
    """Columns of `root_of` that belong to each term.

    Returns
    -------
    list of ndarray of int, shape (k,) each
        None of a term of no size.
    """
    begin, out = 0, dict[int, Ints]()
    for triad in TRIADS:
        for k, term in enumerate(terms):
            if term.triad == triad:
                size = len(term.axes) * cut.mode(term.kind, term.tau).shape[1] if term.size > 0.0 else 0
                out[k] = np.arange(begin, begin + size)
                begin += size
    return [out[k] for k in range(len(terms))]


def triad_root(terms: Sequence[NoiseTerm], cut: Stretches, triad: str) -> tuple[Floats, Ints]:
    """Square root of the covariance of the terms of a triad.

    Returns
    -------
    root : ndarray, shape (n, r)
        Modes of the terms for a sensor that has all of them, of n cells.
    own : ndarray of int, shape (k,)
        Those of the 3 r columns, mode by axis, that a sensor has which a term is of.
    """
    of_triad = [t for t in terms if t.triad == triad and t.size > 0.0]
    roots = [t.size * cut.mode(t.kind, t.tau) for t in of_triad]
    if not roots:
        return np.zeros((cut.cells, 0)), np.zeros(0, dtype=np.int64)
    own, begin = [], 0
    for term, root in zip(of_triad, roots, strict=True):
        own.append(begin + own_columns(term.axes, root.shape[1]))
        begin += 3 * root.shape[1]
    return np.hstack(roots), np.concatenate(own)


def own_columns(axes: Sequence[int], modes: int) -> Ints:
    """Columns of some sensors, among those of three.

    Parameters
    ----------
    modes : int
        r modes of the term.

    Returns
    -------
    ndarray of int, shape (k,)
        Among 3 r, mode by axis.
    """
    return np.asarray((3 * np.arange(modes)[:, None] + np.array(axes)).ravel())


def times(J: Floats, root: Floats, own: Ints) -> Floats:
    """Spread the columns of a matrix over modes, ``J (root x I3)``.

    Parameters
    ----------
    J : ndarray, shape (m, 3 n)
        Any unit; its columns are those of three sensors in n cells.
    root : ndarray, shape (n, r)
        Modes for one sensor (SI).
    own : ndarray of int, shape (k,)
        Columns of the result that are wanted, among 3 r.

    Returns
    -------
    ndarray, shape (m, k)
        In the unit of J times SI.
    """
    n, r = root.shape
    every = np.tensordot(J.reshape(-1, n, 3), root, axes=(1, 0)).transpose(0, 2, 1).reshape(len(J), 3 * r)
    return np.ascontiguousarray(every if len(own) == 3 * r else every[:, own])


def spread(J: Floats, terms: Sequence[NoiseTerm], cut: Stretches) -> Floats:
    """Spread the columns of a matrix over independent modes of unit variance, ``JR`` with the root of `root_of`.

    Parameters
    ----------
    J : ndarray, shape (m, 6 n)
        Inverse units (SI) of the mean errors of n cells.

    Returns
    -------
    ndarray, shape (m, r)
        (1).
    """
    parts = J.reshape(len(J), cut.cells, 2, 3)
    out = [np.zeros((len(J), 0))]
    for k, triad in enumerate(TRIADS):
        root, own = triad_root(terms, cut, triad)
        if len(own):
            out.append(times(np.ascontiguousarray(parts[:, :, k]).reshape(len(J), -1), root, own))
    return np.hstack(out)


def folded(J: Floats, d: Floats, terms: Sequence[NoiseTerm], cut: Stretches) -> tuple[Floats, Floats, Floats]:
    """Information on independent modes of unit variance, with what is known of them before the data.

    Parameters
    ----------
    J : ndarray, shape (6 n, 6 n)
        Information on the mean errors of n cells, inverse squares of their units (SI).
    d : ndarray, shape (6 n,)

    Returns
    -------
    M : ndarray, shape (r, r)
        ``I + R'JR`` with the root R of `root_of` (1).
    y : ndarray, shape (r,)
        ``R'd`` (1).
    across : ndarray, shape (6 n, r)
        ``JR``, inverse units (SI) of the errors.
    """
    across = spread(J, terms, cut)
    M = spread(np.ascontiguousarray(across.T), terms, cut)
    M[np.diag_indices_from(M)] += 1.0
    return M, spread(d[None], terms, cut)[0], across
