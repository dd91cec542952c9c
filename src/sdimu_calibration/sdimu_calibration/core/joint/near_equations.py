"""Which equations that no physics names come near what a set shows, so that the search may weigh them.

Three wrong effects that look like one unknown cause together, a function of the attitude, noise that no sensor has:
each asks for equations, as in one recording. The information of all recordings on each equation, with any of the
effects that were told left out, says which of hundreds could be in a probable model.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import chain, combinations

import numpy as np

from sdimu_calibration.core.arrays import Floats, Ints
from sdimu_calibration.core.diagnosis.rounds import are_parts
from sdimu_calibration.core.effects.effect import Effect
from sdimu_calibration.core.estimation.handheld_fit import HandheldFit
from sdimu_calibration.core.evidence.information import solved
from sdimu_calibration.core.evidence.testable import TESTABLE
from sdimu_calibration.core.joint.equation_share import EquationShare, single_equations
from sdimu_calibration.core.joint.set_fit import Run, SetOptions, job_of
from sdimu_calibration.core.joint.set_found import SetSearch
from sdimu_calibration.core.joint.set_search import places_of_chosen
from sdimu_calibration.core.recording import DataError

_MANY = 3
"""Number of effects from which one equation is tried in their place: so many may be the parts of one cause."""
_MEMBER = 6.0
"""Log posterior (1) that a model gains with each effect that one equation stands for: its odds and its freedom."""
_LEAST = 2.0
"""Log likelihood (1) that an equation gains at least, its members counted: two sigma, less is chance of hundreds."""
_MOST = 40
"""Number of equations that are weighed at most: each is a column of every recording; a cause has some look-alikes."""
_EVERY = 6
"""Number of told effects up to which any of them may be left out: of more one or two, or all, as choices double."""


def asks_for_equations(found: SetSearch) -> bool:
    """Whether what was found may be the parts of a cause that the catalogue lacks, or stands for one."""
    if any(report.estimator == HandheldFit.estimator for report in found.after.reports):
        return False
    drawn = any(found.drawn_in(k) for k in range(len(found.after.reports)))
    at, covariance = places_of_chosen(found), found.after.estimate.covariance
    parts = len(at) >= _MANY or are_parts(found.chosen, covariance[np.ix_(at, at)])
    return parts or found.function_is_likely or drawn or not found.stood


def near_equations(found: SetSearch, run: Run) -> tuple[Effect, ...]:
    """Find the equations that could be in a probable model of a set, those that gain most first.

    Parameters
    ----------
    found : SetSearch
        Without equations.
    run : callable
        Does the jobs.
    """
    fit = found.after
    at = places_of_chosen(found)
    told = tuple(fit.names[place] for place in at)
    options = SetOptions(fit.model, local=fit.local)
    jobs = [replace(job_of(member, options, fit, learn=False), function=None, equations=told) for member in fit.members]
    shares = [done.equations for done in run(jobs) if not isinstance(done, DataError) and done.equations is not None]
    if not shares:
        return ()
    all_ = _together(shares)
    gain = gains_in_place(all_, fit.estimate.values[at], fit.weight[at])
    order = np.argsort(-gain, kind="stable")[:_MOST]
    known = single_equations(has_temperature=True)
    return tuple(known[all_.labels[k]] for k in order.tolist() if gain[k] > _LEAST)


def _together(shares: Sequence[EquationShare]) -> EquationShare:
    """Add what recordings say; of equations that some cannot have (without a temperature), what all can."""
    labels = tuple(label for label in shares[0].labels if all(label in share.labels for share in shares[1:]))

    def at(share: EquationShare) -> Ints:
        place = {label: k for k, label in enumerate(share.labels)}
        return np.array([place[label] for label in labels], dtype=np.int64)

    rows = [at(share) for share in shares]
    return EquationShare(
        labels,
        shares[0].told,
        np.sum([share.J_told for share in shares], axis=0),
        np.sum([share.across[k] for share, k in zip(shares, rows, strict=True)], axis=0),
        np.sum([share.own[k] for share, k in zip(shares, rows, strict=True)], axis=0),
        np.sum([share.d_told for share in shares], axis=0),
        np.sum([share.d[k] for share, k in zip(shares, rows, strict=True)], axis=0),
    )


def gains_in_place(share: EquationShare, values: Floats, weight: Floats) -> Floats:
    """Log likelihood (1) that each equation gains over what was told, in the place of some of it or beside all.

    Parameters
    ----------
    share : EquationShare
        Of all recordings, n equations and t told effects.
    values, weight : ndarray, shape (t,)
        Estimate of what was told (SI), about which the pulls are, and its prior information (1/SI^2).

    Returns
    -------
    ndarray, shape (n,)
        `_MEMBER` counts for each told effect that is left out; -inf for an equation that coefficients take up.
    """
    d_told, d = share.d_told + share.J_told @ values, share.d + share.across @ values
    A = share.J_told + np.diag(weight)
    count = len(values)
    full, best = _explained(A, d_told), np.full(len(d), -np.inf)
    for kept in _choices(count):
        at = np.array(kept, dtype=np.int64)
        X = solved(A[np.ix_(at, at)], np.column_stack([share.across[:, at].T, d_told[at]]))
        c = share.own - np.einsum("nk,kn->n", share.across[:, at], X[:, :-1])
        r = d - share.across[:, at] @ X[:, -1]
        seen = (c > TESTABLE**2 * share.own) & (share.own > 0.0)
        more = 0.5 * r**2 / np.where(seen, c, 1.0)
        lost = full - _explained(A[np.ix_(at, at)], d_told[at])
        best = np.maximum(best, np.where(seen, more - lost + _MEMBER * (count - len(kept)), -np.inf))
    return best


def _choices(count: int) -> list[tuple[int, ...]]:
    """Choices of told effects that stay beside an equation."""
    sizes = range(count + 1) if count <= _EVERY else (0, count - 2, count - 1, count)
    return list(chain.from_iterable(combinations(range(count), size) for size in sizes))


def _explained(A: Floats, d: Floats) -> float:
    return 0.5 * float(d @ solved(A, d[:, None])[:, 0]) if len(d) else 0.0
