"""Whether what a set leaves unexplained comes back at the same attitude, time or temperature, or not at all.

Leftovers u of dwells show in scores s with information G: ``cov s = G + G K G``, K the covariance of u. Under the
hypothesis that nothing comes back, the leftovers of two recordings are independent: each sensor of each recording has
its own scatter from dwell to dwell and its own functions of attitude, time and temperature, the sizes by maximum
likelihood. With ``x = (I + G K)^-1 s``, whose covariance is ``F = (I + G K)^-1 G``, the score test of a function common
to all recordings is ``x' C x``, C the likeness of places in *different* recordings; over that in the same recordings it
is a correlation. Where it is larger than chance makes it, by simulation of x from F, leftovers come back. Of two kinds
that both do, one is needed where it is still larger with the other one in the hypothesis; where neither is, the
recordings cannot tell them apart. Nor can they where the dwells of one kind have the partners that they have in
another: both are then the answer, whatever the score of the other one.

Sources: X. Lin, "Variance component testing in generalised linear models with random effects", Biometrika 84 (1997)
(score test of a variance); H. Zhou et al., "MM algorithms for variance components models", J. Comput. Graph. Stat. 28
(2019) (the sizes).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from sdimu_calibration.core.arrays import Floats, Ints
from sdimu_calibration.core.diagnosis.free_input_test import FreeInputTest, free_input_test
from sdimu_calibration.core.effects.effect import CHANNELS
from sdimu_calibration.core.evidence.information import Information
from sdimu_calibration.core.joint.leftovers import KINDS, Leftovers

_LEFT = 1e-3
"""Probability that the leftovers of some sensor of a right model are so large: below it something is left."""
_ASIDE = 0.1
"""Share of the largest mean square of a sensor (1) from which the leftovers of another one count: below is what a
strong one leaves in the others, as an error that changes within a stop looks like a tilt."""
_FALSE_ALARM = 0.01
"""Share of sets in which leftovers that do not come back are said to (1): what is said sends people to the table."""
_DRAWS = 4000
"""Number of simulated sets of scores: chance at one in a hundred is then known to a sixth."""
_SEED = 20240607
"""Seed (1) of these draws: the same set has the same answer."""
_ROUNDS = 40
"""Number of steps to the sizes: the test changes by less than chance after half of them."""
_FREE = 0.01
"""Share of the variance of a score (1) that the coefficients must leave: with less they take up what comes back so."""
_ALMOST = 0.9999
"""Largest correlation (1): above it is rounding."""
_OPEN = 2.0
"""Score (sigma) from which a kind is not ruled out: chance reaches it once in forty."""
_SAME_ORDER = 0.7
"""Share of dwells (1) that have one partner in both kinds, from which recordings do not tell the kinds apart: a plan in
another order leaves a fifth, by chance."""
_LEAST_PAIRS = 6
"""Number of pairs of dwells below which recordings say nothing: chance makes any correlation of a few."""


@dataclass(frozen=True)
class Kind:
    """Whether leftovers come back with one kind of place."""

    kind: str
    """One of `KINDS`."""
    pairs: int
    """Pairs of dwells of different recordings that are alike."""
    correlation: float
    """Of leftovers that are alike, the largest of the sensors; NaN where the recordings say nothing of it."""
    score: float
    """The same over its sigma by chance after Fisher's transformation, the largest of the sensors and of all together.
    """
    sensors: tuple[str, ...]
    """Those whose own score exceeds chance."""


@dataclass(frozen=True)
class Recurrence:
    """What leftovers come back with."""

    answer: tuple[str, ...]
    """Of `KINDS`; empty where nothing comes back."""
    apart: bool
    """False where the recordings cannot tell the kinds of the answer apart."""
    kinds: tuple[Kind, ...]
    limit: float
    """Score that chance reaches in one set of a hundred, all kinds and sensors counted; NaN where the recordings share
    too few stops."""
    sensors: tuple[str, ...]
    """Those where most is left."""
    p_value: float
    """Probability that a right model leaves so much, all sensors counted."""

    @property
    def told(self) -> tuple[str, ...]:
        """Kinds that leftovers come back with, or certainly do not."""
        return tuple(k.kind for k in self.kinds if k.kind in self.answer or k.score < _OPEN)

    @property
    def doubtful(self) -> tuple[str, ...]:
        """Kinds whose score is more than usual and less than chance reaches, the largest first."""
        near = [k for k in self.kinds if k.kind not in self.answer and k.score >= _OPEN]
        return tuple(k.kind for k in sorted(near, key=lambda k: -k.score))


def recurrence(left: Leftovers) -> Recurrence | None:
    """Judge the leftovers of a set.

    Parameters
    ----------
    left : Leftovers
        Of two recordings or more.

    Returns
    -------
    Recurrence or None
        None where nothing is left that a right model does not leave.
    """
    tests = {int(g): _chance(left, int(g)) for g in np.unique(left.sensor)}
    loud = [g for g, t in tests.items() if t.p_value * len(tests) < _LEFT]
    if not loud or len(np.unique(left.recording)) < 2:
        return None
    excess = {g: tests[g].chi2 / tests[g].dof - 1.0 for g in loud}
    main = [g for g in loud if excess[g] > _ASIDE * max(excess.values())]
    left = left.only(np.flatnonzero(np.isin(left.sensor, loud)))
    alone = _tested(left, main, ())
    found = [kind for kind in KINDS if alone.largest(kind) > alone.limit]
    needed, apart = (found, True) if len(found) < 2 else _needed(left, main, found)
    seen = [kind for kind in KINDS if np.isfinite(alone.largest(kind))]
    answer = [kind for kind in seen if kind in needed or _in_same_order(left, kind, needed)]
    apart = apart and len(answer) == len(needed)
    return Recurrence(
        tuple(answer),
        apart,
        tuple(_kind(left, main, alone, k) for k in KINDS),
        alone.limit,
        tuple(CHANNELS[g] for g in main),
        min(1.0, len(tests) * min(t.p_value for t in tests.values())),
    )


def _needed(left: Leftovers, main: Sequence[int], found: Sequence[str]) -> tuple[Sequence[str], bool]:
    """Say which of several kinds are needed beside the others, and whether they can be told apart."""
    if any(_in_same_order(left, one, [other]) for one, other in combinations(found, 2)):
        return found, False
    given = {other: _tested(left, main, (other,)) for other in found}
    needed = [k for k in found if all(t.largest(k) > t.limit for other, t in given.items() if other != k)]
    return (needed, True) if needed else (found, False)


def _in_same_order(left: Leftovers, kind: str, others: Sequence[str]) -> bool:
    """Whether dwells have the same partners in a kind as in another: then nothing tells the two apart."""
    return any(left.coincide(kind, other) > _SAME_ORDER for other in others)


def _chance(left: Leftovers, group: int) -> FreeInputTest:
    """Test whether one sensor has leftovers that a right model does not leave."""
    mine, none = np.flatnonzero(left.sensor == group), np.empty(0, dtype=np.int64)
    return free_input_test(Information(left.gram, left.score), none, np.empty(0), mine)


@dataclass(frozen=True)
class _Test:
    """Correlations and scores by kind, of each sensor; the last score of all together; NaN where nothing is seen."""

    correlation: dict[str, Floats]
    scores: dict[str, Floats]
    limit: float

    def largest(self, kind: str) -> float:
        return _largest(self.scores[kind])


def _largest(values: Floats) -> float:
    seen = values[np.isfinite(values)]
    return float(seen.max()) if len(seen) else float("nan")


def _kind(left: Leftovers, main: Sequence[int], test: _Test, kind: str) -> Kind:
    own = zip(main, test.scores[kind][:-1].tolist(), strict=True)
    over = tuple(CHANNELS[g] for g, z in own if z > test.limit)
    return Kind(kind, left.pairs(kind), _largest(test.correlation[kind]), test.largest(kind), over)


@dataclass(frozen=True)
class _Component:
    """A part of the covariance of the leftovers of one sensor: places (k,) and kernel (k, k) of unit size."""

    places: Ints
    kernel: Floats


def _tested(left: Leftovers, main: Sequence[int], common: Sequence[str]) -> _Test:
    """Test every kind in the sensors `main` against leftovers that come back in the kinds `common` alone."""
    groups = [np.flatnonzero(left.sensor == g) for g in np.unique(left.sensor)]
    x, F = _fitted(left, [part for mine in groups for part in _components(left, mine, common)])
    draws = np.column_stack([x, _drawn(F)])
    asked = [np.flatnonzero(left.sensor == g) for g in main]
    correlation, scores, chance = {}, {}, []
    for kind in KINDS:
        of_all = np.array([_correlation(left, kind, mine, draws) for mine in asked])
        # Fisher's transformation makes the scatter of a correlation the same at any size.
        even = np.arctanh(np.clip(of_all, -_ALMOST, _ALMOST))
        even = (even - even[:, 1:].mean(axis=1)[:, None]) / even[:, 1:].std(axis=1)[:, None]
        seen = np.isfinite(even[:, 0])
        together = even[seen].sum(axis=0) / np.sqrt(seen.sum()) if seen.any() else np.full(draws.shape[1], np.nan)
        every = np.vstack([even, together])
        correlation[kind], scores[kind] = of_all[:, 0], every[:, 0]
        chance.append(np.where(np.isfinite(every[:, 1:]), every[:, 1:], -np.inf).max(axis=0))
    largest = np.max(chance, axis=0)
    limit = float(np.quantile(largest, 1.0 - _FALSE_ALARM)) if np.isfinite(largest).all() else float("nan")
    return _Test(correlation, scores, limit)


def _components(left: Leftovers, mine: Ints, common: Sequence[str]) -> list[_Component]:
    """Scatter of a sensor, and its functions of each kind: of each recording alone, or common to all."""
    square = np.ix_(mine, mine)
    same = (left.recording[mine][:, None] == left.recording[mine][None, :]).astype(np.float64)
    own = [_Component(mine, left.likeness[kind][square] * same) for kind in KINDS]
    shared = [_Component(mine, left.likeness[kind][square]) for kind in common]
    return [part for part in (_Component(mine, np.eye(len(mine))), *own, *shared) if part.kernel.any()]


def _fitted(left: Leftovers, parts: Sequence[_Component]) -> tuple[Floats, Floats]:
    """Return x (m,) and its covariance F (m, m) with the sizes of the components by maximum likelihood."""
    m = len(left.score)
    sizes = np.ones(len(parts))
    x, F = left.score, left.gram
    for turn in range(_ROUNDS + 1):
        K = np.zeros((m, m))
        for part, size in zip(parts, sizes.tolist(), strict=True):
            K[np.ix_(part.places, part.places)] += size * part.kernel
        both = np.linalg.solve(np.eye(m) + left.gram @ K, np.column_stack([left.gram, left.score]))
        x = np.asarray(both[:, -1], dtype=np.float64)
        F = np.asarray(0.5 * (both[:, :-1] + both[:, :-1].T), dtype=np.float64)
        if turn == _ROUNDS:
            break
        for k, part in enumerate(parts):
            mine = part.places
            fall = float(x[mine] @ part.kernel @ x[mine])
            free = float(np.sum(part.kernel * F[np.ix_(mine, mine)]))
            sizes[k] *= np.sqrt(max(fall, 0.0) / free) if free > 0.0 else 0.0
    return x, F


def _drawn(F: Floats) -> Floats:
    """Draw scores x by chance, shape (m, draws)."""
    values, vectors = np.linalg.eigh(F)
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    return np.asarray(root @ np.random.default_rng(_SEED).standard_normal((len(F), _DRAWS)))


def _correlation(left: Leftovers, kind: str, mine: Ints, x: Floats) -> Floats:
    """Correlation of the scores x (m, n) of a sensor in one recording with those in the others, shape (n,).

    ``x' C x / ((R - 1) x' K x)``, C the likeness of places in different recordings, K that in the same: between -1
    and 1, as both together are positive semidefinite. NaN where the coefficients take up all that might come back.
    """
    square = np.ix_(mine, mine)
    alike, own = left.likeness[kind][square], left.gram[square]
    same = left.recording[mine][:, None] == left.recording[mine][None, :]
    C, K = np.where(same, 0.0, alike), np.where(same, alike, 0.0)
    through = C @ own
    alone = float(np.sum(C**2 * np.outer(np.diag(own), np.diag(own))))
    few = left.pairs(kind) < _LEAST_PAIRS
    if few or not float(np.sum(through * through.T)) > _FREE * alone:
        return np.full(x.shape[1], np.nan)
    across, within = (np.einsum("id,ij,jd->d", x[mine], M, x[mine], optimize=True) for M in (C, K))
    return np.asarray(across / ((len(np.unique(left.recording)) - 1) * within))
