"""What one recording says of equations that no physics names, its own coefficients taken out.

Hundreds of equations in the rows of every recording would cost more than the rest of a search. What a recording says of
each of them by itself, and beside what was told, is a few numbers; their sum over the recordings tells which equations
come near (`near_equations`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.diagnosis.candidates import equations
from sdimu_calibration.core.effects.effect import Effect
from sdimu_calibration.core.effects.selection import resolve
from sdimu_calibration.core.estimation.fit import Fit
from sdimu_calibration.core.evidence.candidate import OWN
from sdimu_calibration.core.evidence.information import solved
from sdimu_calibration.core.evidence.stretch_length import wander_in
from sdimu_calibration.core.evidence.testable import TESTABLE
from sdimu_calibration.core.joint.scope import by_name
from sdimu_calibration.core.posterior.board import Board
from sdimu_calibration.core.posterior.noise_models import NoiseModel

_BLOCK = 100
"""Number of equations whose signatures are in memory at once: of a recording of a day some hundred megabytes."""


@dataclass(frozen=True)
class EquationShare:
    """Information on n equations and on t effects that were told, the recording's other coefficients taken out."""

    labels: tuple[str, ...]
    """Of the equations, length n."""
    told: tuple[str, ...]
    """Names of the effects in the fit, length t."""
    J_told: Floats
    """Shape (t, t). 1/SI^2."""
    across: Floats
    """Shape (n, t)."""
    own: Floats
    """Shape (n,)."""
    d_told: Floats
    d: Floats
    """`d_told`, `d`: shapes (t,) and (n,). Pull about the fit (1/SI)."""


@cache
def single_equations(has_temperature: bool) -> Mapping[str, Effect]:
    """Every equation of `candidates.equations`, of one parameter each, by its label."""
    return {one.labels[0]: one for effect in equations(has_temperature) for one in effect.singles}


def asked(named: str | Effect) -> Effect:
    """Find a candidate by its key or, of an equation, by its label; an effect is itself."""
    known = single_equations(has_temperature=True)
    return known[named] if isinstance(named, str) and named in known else resolve(named)


def name_of_candidate(effect: Effect) -> str | Effect:
    """Name a candidate so that another process finds it by `asked`; an effect of the user's own stands for itself."""
    is_equation = effect.title == OWN and effect.labels[0] in single_equations(has_temperature=True)
    return effect.labels[0] if is_equation else by_name(effect)


def equation_share(fit: Fit, told: Sequence[str]) -> EquationShare:
    """Say what a recording holds of equations, in the noise that it has learned.

    Parameters
    ----------
    fit : Fit
        About the estimate of the set.
    told : sequence of str
        Coefficients of the fit that stand for effects that were told; those that it lacks are zero.
    """
    wander = wander_in(fit.bare, fit.noise_terms)
    evidence = fit.bare.in_inner(wander.inner)
    board, noise = Board(evidence, np.empty(0, np.int64), frozenset(), wander), NoiseModel(tuple(fit.noise_terms))
    one, p = board.in_noise(noise), len(evidence.weight)
    effects = list(single_equations(fit.has_temperature).values())
    blocks = [effects[k : k + _BLOCK] for k in range(0, len(effects), _BLOCK)]
    seen = [board.seen_of(evidence.signature(block), np.arange(p), noise) for block in blocks]
    own, across, d = (np.concatenate(parts) for parts in zip(*seen, strict=True))
    place = {name: k for k, name in enumerate(evidence.names[:p])}
    have = np.array([k for k, name in enumerate(told) if name in place], dtype=np.int64)
    at = np.array([place[told[k]] for k in have], dtype=np.int64)
    rest = np.setdiff1d(np.arange(p), at)
    A = one.J[np.ix_(rest, rest)] + np.diag(evidence.weight[rest])
    X = solved(A, np.column_stack([one.J[np.ix_(rest, at)], one.d[rest], across[:, rest].T]))
    of_told, of_d, of_each = X[:, : len(at)], X[:, len(at)], X[:, len(at) + 1 :]
    J, wide, pull = np.zeros((len(told), len(told))), np.zeros((len(own), len(told))), np.zeros(len(told))
    J[np.ix_(have, have)] = one.J[np.ix_(at, at)] - one.J[np.ix_(at, rest)] @ of_told
    wide[:, have] = across[:, at] - across[:, rest] @ of_told
    # The prior of what was told is no part of what this recording says.
    pull[have] = one.d[at] - evidence.weight[at] * evidence.shift[at] - one.J[np.ix_(at, rest)] @ of_d
    left = own - np.einsum("nk,kn->n", across[:, rest], of_each)
    return EquationShare(
        tuple(effect.labels[0] for effect in effects),
        tuple(told),
        J,
        wide,
        # What the coefficients of the recording take up is not seen in it.
        np.where(left > TESTABLE**2 * own, left, 0.0),
        pull,
        d - across[:, rest] @ of_d,
    )
