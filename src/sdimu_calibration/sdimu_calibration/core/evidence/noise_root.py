"""Square root of the covariance of the errors that noise with a memory makes in each stretch of a test.

Each sensor of a term draws its own error from one kernel, so a root is that of one sensor (n cells by r modes) for each
of the sensors that the term is of. Terms of the same sensors have one root together, of no more modes than cells: only
what follows something is told apart afterwards. Columns come triad by triad, of a triad root by root, of a root axis by
axis.
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence

import numpy as np

from sdimu_calibration.core.arrays import Floats, Ints
from sdimu_calibration.core.evidence.noise_kernels import Stretches
from sdimu_calibration.core.noise_term import FOLLOWS, TRIADS, NoiseTerm

Root = tuple[Floats, tuple[int, ...]]
"""Modes of noise for one sensor (SI), shape (n, r) of n cells, and the axes of the sensors that have it."""


def root_of(terms: Sequence[NoiseTerm], cut: Stretches) -> Floats:
    """Square root R of the covariance of the mean errors, ``K = RR'``.

    Returns
    -------
    ndarray, shape (6 n, r)
        SI.
    """
    parts = [np.zeros((6 * cut.cells, 0))]
    for first, triad in zip((0, 3), TRIADS, strict=True):
        for root, axes in triad_roots(terms, cut, triad):
            every = np.zeros((cut.cells, 6, len(axes), root.shape[1]))
            for place, axis in enumerate(axes):
                every[:, first + axis, place] = root
            parts.append(every.reshape(6 * cut.cells, -1))
    return np.hstack(parts)


def columns_of(terms: Sequence[NoiseTerm], cut: Stretches) -> list[Ints]:
    """Columns of `root_of` that belong to each term.

    Returns
    -------
    list of ndarray of int, shape (k,) each
        Terms of one root share them; none of a term of no size.
    """
    begin, out = 0, [np.zeros(0, dtype=np.int64) for _ in terms]
    for triad in TRIADS:
        for group, (root, axes) in zip(_groups(terms, triad), triad_roots(terms, cut, triad), strict=True):
            size = len(axes) * root.shape[1]
            for k in group:
                out[k] = np.arange(begin, begin + size)
            begin += size
    return out


def _groups(terms: Sequence[NoiseTerm], triad: str) -> list[list[int]]:
    """Places of the terms of a triad that have one root: those of the same sensors that follow nothing."""
    out: dict[Hashable, list[int]] = {}
    for k, term in enumerate(terms):
        if term.triad == triad and term.size > 0.0:
            out.setdefault(term.identity if term.kind in FOLLOWS else term.axes, []).append(k)
    return list(out.values())


def triad_roots(terms: Sequence[NoiseTerm], cut: Stretches, triad: str) -> list[Root]:
    """Square roots of the covariance of the terms of a triad.

    Returns
    -------
    list of Root
    """
    out = []
    for group in _groups(terms, triad):
        roots = [terms[k].size * cut.mode(terms[k].kind, terms[k].tau) for k in group]
        out.append((roots[0] if len(roots) == 1 else _together(roots, len(cut)), terms[group[0]].axes))
    return out


def _together(roots: Sequence[Floats], n: int) -> Floats:
    """Square root of the sum of the covariances of several roots, which are zero behind n stretches."""
    every = np.hstack(roots)
    if every.shape[1] <= n:
        return every
    out = np.zeros((len(every), n))
    out[:n] = np.transpose(np.linalg.qr(every[:n].T, mode="r"))
    return out


def times(J: Floats, root: Floats, axes: Sequence[int]) -> Floats:
    """Spread the columns of a matrix over modes of some sensors, ``J (I3 x root)``.

    Parameters
    ----------
    J : ndarray, shape (m, 3 n)
        Any unit; its columns are those of three sensors in n cells, axis by cell.
    root : ndarray, shape (n, r)
        Modes for one sensor (SI).
    axes : sequence of int, length a
        Sensors that are wanted.

    Returns
    -------
    ndarray, shape (m, a r)
        In the unit of J times SI; axis by mode.
    """
    n, r = root.shape
    own = J.reshape(len(J), 3, n)
    own = own if len(axes) == 3 else own[:, list(axes)]
    return np.asarray((own.reshape(-1, n) @ root).reshape(len(J), len(axes) * r))


def spread_in_triad(J: Floats, roots: Sequence[Root]) -> Floats:
    """Spread the columns of a matrix over the modes of a triad, root by root.

    Parameters
    ----------
    J : ndarray, shape (m, 3 n)
        Any unit; as of `times`.

    Returns
    -------
    ndarray, shape (m, r)
        In the unit of J times SI.
    """
    parts = [times(J, *one) for one in roots]
    return parts[0] if len(parts) == 1 else np.hstack([np.zeros((len(J), 0)), *parts])


def in_modes(J: Floats, d: Floats, roots: Sequence[Root]) -> tuple[Floats, Floats, Floats]:
    """Information on the modes of a triad, with what is known of them before the data.

    Parameters
    ----------
    J : ndarray, shape (3 n, 3 n)
        Information on the mean errors of its sensors, axis by cell, inverse squares of their units (SI).
    d : ndarray, shape (3 n,)

    Returns
    -------
    M : ndarray, shape (r, r)
        ``I + R'JR`` (1).
    y : ndarray, shape (r,)
        ``R'd`` (1).
    across : ndarray, shape (3 n, r)
        ``JR``, inverse units (SI) of the errors.
    """
    across = spread_in_triad(J, roots)
    M = spread_in_triad(np.ascontiguousarray(across.T), roots)
    M[np.diag_indices_from(M)] += 1.0
    return M, spread_in_triad(d[None], roots)[0], across


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
    of_triads = [np.ascontiguousarray(parts[:, :, k].transpose(0, 2, 1)).reshape(len(J), -1) for k in range(2)]
    return np.hstack(
        [spread_in_triad(own, triad_roots(terms, cut, triad)) for own, triad in zip(of_triads, TRIADS, strict=True)]
    )


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
