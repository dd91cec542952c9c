"""One scatter of the recordings by hand of a set, learned about coefficients that all of them share.

A run of few rests learns its scatter from what its own coefficients leave over, which is little: by chance far too
small, and the coefficients then seem to differ from recording to recording. All runs of a set together leave over more.
A run has a scatter of its own where all that is left over, that of the others in theirs included, is likelier so: by
more than the Bayesian information criterion counts for three parameters (G. Schwarz, Ann. Stat. 6, 1978).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from sdimu_calibration.core.arrays import Bools, Floats, Ints
from sdimu_calibration.core.handheld.run_rows import RunRows
from sdimu_calibration.core.handheld.run_scatter import WHOLE, RunScatter, learned, stacked_scatters

_MOST_STEPS = 40
"""Number of steps at most: weights and residuals follow each other until both stand."""
_STANDS = 1e-2
"""Share of a learned sigma by which a step changes it at most where it stands: it is known to a tenth."""


@dataclass(frozen=True)
class _Run:
    """One run in the parameters of the set."""

    rows: RunRows
    place: Ints
    """Of its coefficients among the parameters of the set, shape (q,)."""


def shared_scatter(
    runs: Mapping[str, RunRows], weight: Mapping[str, float], own: Mapping[str, Mapping[str, str]]
) -> dict[str, Floats]:
    """Learn the scatter that runs share.

    Parameters
    ----------
    runs : mapping of str to RunRows
        By recording.
    weight : mapping of str to float
        Prior information of the coefficients (1/SI^2), prior mean zero.
    own : mapping of str to mapping of str to str
        By recording, names for the set of coefficients that are not the same in all recordings.

    Returns
    -------
    dict of str to ndarray, shape (3,)
        Sigmas as of `RunScatter.sigmas`, of every recording; empty for a single one.
    """
    if len(runs) < 2:
        return {}
    put, known = _placed(runs, weight, own)
    sharing, apart = list(runs), list[str]()
    begin = np.sqrt(np.mean([one.extra**2 for one in runs.values()], axis=0))
    extra = dict.fromkeys(runs, np.asarray(begin, dtype=np.float64))
    while True:
        extra, leftovers = _learned(put, (sharing, *([name] for name in apart)), extra, known)
        shared = {name: leftovers[name] for name in sharing}
        gains = {name: _gain_of_parting(shared, name, extra[name]) for name in sharing if len(sharing) > 1}
        first = max(gains, key=gains.__getitem__, default="")
        if not gains or gains[first] <= 0.0:
            return extra
        sharing.remove(first)
        apart.append(first)
        extra[first] = leftovers[first].likeliest(extra[first])


def _placed(
    runs: Mapping[str, RunRows], weight: Mapping[str, float], own: Mapping[str, Mapping[str, str]]
) -> tuple[dict[str, _Run], Floats]:
    """Place the coefficients of all runs among the parameters of the set, and their prior information, shape (P,)."""
    named = {name: [own.get(name, {}).get(n, n) for n in r.names] for name, r in runs.items()}
    columns = list(dict.fromkeys(n for names in named.values() for n in names))
    known = np.zeros(len(columns))
    for name, rows in runs.items():
        known[[columns.index(n) for n in named[name]]] = [weight[n] for n in rows.names]
    put = {n: _Run(rows, np.array([columns.index(c) for c in named[n]], dtype=np.int64)) for n, rows in runs.items()}
    return put, known


def _learned(
    runs: Mapping[str, _Run], groups: Sequence[Sequence[str]], extra: Mapping[str, Floats], weight: Floats
) -> tuple[dict[str, Floats], dict[str, _LeftOver]]:
    """Learn one scatter of each group, from `extra` on, about coefficients of all; and what each run leaves over."""
    for _ in range(_MOST_STEPS):
        leftovers, before = _left_over(runs, extra, weight), extra
        extra = {}
        for names in groups:
            of_group = _together([leftovers[name] for name in names])
            extra |= dict.fromkeys(names, of_group.learned(before[names[0]]))
        if all(_stands(extra[name], before[name]) for name in runs):
            break
    return dict(extra), leftovers


def _stands(extra: Floats, before: Floats) -> bool:
    return bool(np.all(np.abs(extra - before) <= _STANDS * extra + 1e-12))


def _left_over(runs: Mapping[str, _Run], extra: Mapping[str, Floats], weight: Floats) -> dict[str, _LeftOver]:
    """Estimate coefficients from all runs, each in its scatter; give what each leaves over."""
    J, d = np.diag(weight), np.zeros(len(weight))
    parts = {}
    for name, run in runs.items():
        sigma = run.rows.scatter.sigmas_of_step(extra[name])
        Q = np.linalg.qr(run.rows.own / sigma[:, None])[0]
        A, r = run.rows.shared / sigma[:, None], run.rows.residual / sigma
        A, r = A - Q @ (Q.T @ A), r - Q @ (Q.T @ r)
        J[np.ix_(run.place, run.place)] += A.T @ A
        d[run.place] += A.T @ (A @ run.rows.point - r)
        parts[name] = sigma, Q, A, r
    # In units in which every parameter has an information of one: SI units differ by many orders.
    unit = 1.0 / np.sqrt(np.diag(J))
    root = unit[:, None] * np.linalg.inv(np.linalg.cholesky(J * np.outer(unit, unit))).T
    estimate = root @ (root.T @ d)
    out = {}
    for name, (sigma, Q, A, r) in parts.items():
        run = runs[name]
        left = sigma * (r + A @ (estimate[run.place] - run.rows.point))
        free = 1.0 - np.sum(Q**2, axis=1) - np.sum((A @ root[run.place]) ** 2, axis=1)
        out[name] = _LeftOver(run.rows.scatter, left, free)
    return out


@dataclass(frozen=True)
class _LeftOver:
    """What an estimate leaves over of the equations of some runs."""

    scatter: RunScatter
    left: Floats
    """Residuals (SI), shape (m,)."""
    free: Floats
    """Redundancy of each equation (1), shape (m,)."""

    @property
    def counts(self) -> Bools:
        """Equations whose scatter is learned, shape (m,)."""
        return np.asarray(self.scatter.measured & (self.scatter.kind != WHOLE))

    def learned(self, extra: Floats) -> Floats:
        """Sigmas that make the squares as many as the redundancies, shape (3,), each beside the others of `extra`."""
        return learned(self.scatter, extra, self.left, self.free)

    def likeliest(self, extra: Floats) -> Floats:
        """Return the same, shape (3,), each beside the others found."""
        for _ in range(_MOST_STEPS):
            before, extra = extra, self.learned(extra)
            if _stands(extra, before):
                break
        return extra

    def log_likelihood(self, extra: Floats) -> float:
        """Log-likelihood (1), each equation counted by its redundancy."""
        counts = self.counts
        variance = self.scatter.sigmas(extra)[counts] ** 2
        return -0.5 * float(np.sum(self.free[counts] * np.log(variance) + self.left[counts] ** 2 / variance))


def _together(leftovers: Sequence[_LeftOver]) -> _LeftOver:
    return _LeftOver(
        stacked_scatters([one.scatter for one in leftovers]),
        np.concatenate([one.left for one in leftovers]),
        np.concatenate([one.free for one in leftovers]),
    )


def _gain_of_parting(leftovers: Mapping[str, _LeftOver], name: str, extra: Floats) -> float:
    """Log odds (1) that one run has a scatter of its own, and all others share theirs, against one of all in `extra`.

    The others count, too: in the scatter of a run that is so wild that it makes that of all, none is likely.
    """
    one, rest = leftovers[name], _together([o for n, o in leftovers.items() if n != name])
    apart = sum(part.log_likelihood(part.likeliest(extra)) for part in (one, rest))
    together = sum(part.log_likelihood(extra) for part in (one, rest))
    return apart - together - 0.5 * len(extra) * float(np.log(max(one.free[one.counts].sum(), 2.0)))
