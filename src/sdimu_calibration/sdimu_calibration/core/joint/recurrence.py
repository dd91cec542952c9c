"""Whether what a set leaves unexplained comes back at the same attitude, time or temperature, or not at all.

Leftovers u of dwells show in scores s with information G: ``cov s = G + G K G``, K the covariance of u. Each sensor of
each recording has its own scatter from dwell to dwell and its own functions of attitude, time and temperature; of what
comes back, it has a function besides that all recordings have in common. Each kind may come back or not: the likelihood
of s says how probable each choice of kinds is,

    L = -1/2 log det(I + GK) + 1/2 s' K (I + GK)^-1 s,

with the sizes of what is of each recording at their maximum and that of what is common integrated over its prior.
Recordings in the same order do not tell attitude from time: both are then likely alike.

Sources: H. Patterson, R. Thompson, "Recovery of inter-block information when block sizes are unequal", Biometrika 58
(1971) (the likelihood); H. Zhou et al., "MM algorithms for variance components models", J. Comput. Graph. Stat. 28
(2019) (the sizes).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from sdimu_calibration.core.arrays import Floats, Ints
from sdimu_calibration.core.diagnosis.free_input_test import FreeInputTest, free_input_test
from sdimu_calibration.core.effects.effect import CHANNELS
from sdimu_calibration.core.evidence.information import Information
from sdimu_calibration.core.joint.leftovers import KINDS, Leftovers
from sdimu_calibration.core.posterior.posterior import PROBABLE

_LEFT = 1e-3
"""Probability that the leftovers of some sensor of a right model are so large: below it something is left."""
_ASIDE = 0.1
"""Share of the largest mean square of a sensor (1) from which the leftovers of another one count: below is what a
strong one leaves in the others, as an error that changes within a stop looks like a tilt."""
_ODDS = 0.25
"""Odds (1) before the data that leftovers come back with a kind: noise is what is usually left."""
_SIZES = np.geomspace(0.1, 1e4, 16)
"""Variances (1) that a common function may have, likely alike, over that with which a stop tells the error of a sensor:
from a third to a hundred of its sigmas."""
_BOTH = 0.05
"""Probability of each of two kinds from which both together are looked at: with less they do not explain more."""
_ROUNDS = 60
"""Number of steps to the sizes at most: half of them are enough in most sets."""
_STANDS = 0.01
"""Change of the log of each size (1) below which the sizes stand: the likelihood changes by less than a thousandth."""
_LEAST = 1e-6
"""Variance (1, as of `_SIZES`) below which a size is none: a thousandth of the sigma of a stop."""
_SAME_ORDER = 0.7
"""Share of dwells (1) that have one partner in both kinds, from which recordings do not tell the kinds apart: a plan in
another order leaves a fifth, by chance."""
_FLAT = 0.3
"""Change of the log-likelihood (1) with the size of a common function up to which recordings say nothing of it: it
changes a probability by a tenth at most."""
_OPEN = 0.2
"""Probability that something comes back from which it is open whether it does: the prior of two kinds says .36."""


@dataclass(frozen=True)
class Kind:
    """Whether leftovers come back with one kind of place."""

    kind: str
    """One of `KINDS`."""
    pairs: int
    """Pairs of dwells of different recordings that are alike."""
    probability: float
    """That leftovers come back with it; NaN where the recordings say nothing of it."""


@dataclass(frozen=True)
class Recurrence:
    """What leftovers come back with."""

    kinds: tuple[Kind, ...]
    probability: float
    """That they come back with any kind (1)."""
    sensors: tuple[str, ...]
    """Those where most is left."""
    p_value: float
    """Probability that a right model leaves so much, all sensors counted."""

    @property
    def answer(self) -> tuple[str, ...]:
        """Kinds that leftovers come back with; several where the recordings cannot tell them apart; none: empty."""
        likely = tuple(k.kind for k in self.kinds if k.probability > PROBABLE)
        # Three that nothing tells apart have a third each.
        open_ = tuple(k.kind for k in self.kinds if k.probability > _OPEN * self.probability)
        return likely or (open_ if self.probability > PROBABLE and len(open_) > 1 else ())

    @property
    def apart(self) -> bool:
        """Whether the recordings tell the kinds of the answer apart."""
        return all(k.probability > PROBABLE for k in self.kinds if k.kind in self.answer)

    @property
    def told(self) -> tuple[str, ...]:
        """Kinds of which the recordings say something."""
        return tuple(k.kind for k in self.kinds if np.isfinite(k.probability))

    def may_come_back(self, kind: str) -> bool:
        """Whether it is not improbable that they come back with a kind; False where the recordings say nothing."""
        return any(k.kind == kind and k.probability > _OPEN for k in self.kinds)

    def judged(self, kind: str, probability: float) -> Recurrence:
        """Return the same with the probability of a kind that all rows tell, in the place of that which stops tell."""
        before = float(np.nan_to_num(next(k.probability for k in self.kinds if k.kind == kind)))
        kinds = tuple(replace(k, probability=probability) if k.kind == kind else k for k in self.kinds)
        # That another kind comes back, given that this one does not.
        without = (self.probability - before) / (1.0 - before) if before < 1.0 else 0.0
        return replace(self, kinds=kinds, probability=probability + (1.0 - probability) * max(without, 0.0))

    @property
    def is_open(self) -> bool:
        """Whether it is neither probable nor improbable that something comes back."""
        return not self.answer and bool(self.told) and self.probability > _OPEN


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
    found = _weighed(left.only(np.flatnonzero(np.isin(left.sensor, loud))), main)
    told = [Kind(kind, left.pairs(kind), found.get(kind, float("nan"))) for kind in KINDS]
    sensors = tuple(CHANNELS[g] for g in main)
    return Recurrence(tuple(told), found[""], sensors, min(1.0, len(tests) * min(t.p_value for t in tests.values())))


def _chance(left: Leftovers, group: int) -> FreeInputTest:
    """Test whether one sensor has leftovers that a right model does not leave."""
    mine, none = np.flatnonzero(left.sensor == group), np.empty(0, dtype=np.int64)
    return free_input_test(Information(left.gram, left.score), none, np.empty(0), mine)


def _weighed(left: Leftovers, main: Sequence[int]) -> dict[str, float]:
    """Probability of each kind of which the recordings say something, and of any (under an empty name).

    `main` are the sensors (of `CHANNELS`) that may have a common function.
    """
    own = [part for g in np.unique(left.sensor) for part in _of_each(left, np.flatnonzero(left.sensor == g))]
    alone = _fitted(left, own, np.ones(len(own)))
    likelihood = _log_likelihood(left, own, alone)
    by_size = {kind: _gains(left, own, alone, likelihood, main, (kind,)) for kind in KINDS}
    said = [kind for kind, gains in by_size.items() if np.ptp(gains) > _FLAT]
    gain: dict[tuple[str, ...], float] = {(): 0.0} | {(kind,): _mean(by_size[kind]) for kind in said}
    probable = [kind for kind in said if _share(gain, (kind,)) > _BOTH]
    gain |= {both: _mean(_gains(left, own, alone, likelihood, main, both)) for both in combinations(probable, 2)}
    found = {kind: sum(_share(gain, kinds) for kinds in gain if kind in kinds) for kind in said}
    for alike in _in_one_order(left, said):
        # What a turn leaves in the stop behind it follows the order, whatever causes it.
        any_of = sum(_share(gain, kinds) for kinds in gain if alike & set(kinds))
        found |= dict.fromkeys(alike, any_of / len(alike))
    return found | {"": 1.0 - _share(gain, ())}


def _in_one_order(left: Leftovers, kinds: Sequence[str]) -> list[set[str]]:
    """Part kinds into those that the recordings cannot tell apart, as the dwells have the same partners in them."""
    groups: list[set[str]] = []
    for kind in kinds:
        near = [g for g in groups if any(left.coincide(kind, other) > _SAME_ORDER for other in g)]
        groups = [*(g for g in groups if g not in near), {kind}.union(*near)]
    return groups


def _mean(gains: Floats) -> float:
    """Log of the mean likelihood over all sizes (1)."""
    return float(np.logaddexp.reduce(gains) - np.log(len(gains)))


def _share(gain: dict[tuple[str, ...], float], kinds: tuple[str, ...]) -> float:
    """Probability of a choice of kinds among those that were looked at, by the gain of the log-likelihood of each."""
    score = {one: value + len(one) * np.log(_ODDS) for one, value in gain.items()}
    most = max(score.values())
    return float(np.exp(score[kinds] - most) / sum(np.exp(value - most) for value in score.values()))


@dataclass(frozen=True)
class _Part:
    """A part of the covariance of the leftovers of one sensor: places (k,) and kernel (k, k) of unit size."""

    places: Ints
    kernel: Floats


def _of_each(left: Leftovers, mine: Ints) -> list[_Part]:
    """Scatter of a sensor, and its functions of each kind, of each recording alone."""
    square = np.ix_(mine, mine)
    same = (left.recording[mine][:, None] == left.recording[mine][None, :]).astype(np.float64)
    own = [_Part(mine, left.likeness[kind][square] * same) for kind in KINDS]
    return [part for part in (_Part(mine, np.eye(len(mine))), *own) if part.kernel.any()]


def _gains(
    left: Leftovers, own: list[_Part], alone: Floats, likelihood: float, main: Sequence[int], kinds: tuple[str, ...]
) -> Floats:
    """Log-likelihood (1) that common functions of some kinds add, by their size; shape of `_SIZES`.

    `alone` are the sizes of the parts of each recording without them, `likelihood` the log-likelihood with these (1).
    """
    groups = [np.flatnonzero(left.sensor == g) for g in main]
    common = [_Part(mine, left.likeness[kind][np.ix_(mine, mine)]) for mine in groups for kind in kinds]
    if not any(part.kernel.any() for part in common):
        return np.zeros(len(_SIZES))
    beside = _fitted(left, [*own, *common], np.concatenate([alone, np.ones(len(common))]))
    # Sensors and kinds differ in size; how large all of them are together nobody knows.
    shape = np.maximum(beside[len(own) :], _LEAST)
    shape = shape / np.exp(np.mean(np.log(shape)))
    # Beside a small one the others are as large as alone, beside the likeliest as large as with it.
    rest = (alone, beside[: len(own)])
    by_size = [[_log_likelihood(left, [*own, *common], np.append(r, v * shape)) for r in rest] for v in _SIZES]
    return np.asarray(np.max(by_size, axis=1) - likelihood)


def _fitted(left: Leftovers, parts: Sequence[_Part], sizes: Floats) -> Floats:
    """Find the likeliest sizes of the parts, from some on."""
    m = len(left.score)
    for _ in range(_ROUNDS):
        both = np.linalg.solve(
            np.eye(m) + left.gram @ _covariance(m, parts, sizes), np.column_stack([left.gram, left.score])
        )
        x, F = both[:, -1], both[:, :-1]
        change = np.ones(len(parts))
        for k, part in enumerate(parts):
            mine = part.places
            fall = float(x[mine] @ part.kernel @ x[mine])
            free = float(np.sum(part.kernel * F[np.ix_(mine, mine)]))
            change[k] = np.sqrt(max(fall, 0.0) / free) if free > 0.0 else 0.0
        sizes = sizes * change
        counts = sizes > _LEAST
        if np.all(np.abs(change[counts] - 1.0) < _STANDS):
            break
    return sizes


def _covariance(m: int, parts: Sequence[_Part], sizes: Floats) -> Floats:
    """Covariance (m, m) of leftovers that are the sum of parts."""
    K = np.zeros((m, m))
    for part, size in zip(parts, sizes.tolist(), strict=True):
        K[np.ix_(part.places, part.places)] += size * part.kernel
    return K


def _log_likelihood(left: Leftovers, parts: Sequence[_Part], sizes: Floats) -> float:
    """Log-likelihood (1) of the scores, over that with no leftovers at all."""
    K = _covariance(len(left.score), parts, sizes)
    M = np.eye(len(K)) + left.gram @ K
    return 0.5 * float(left.score @ K @ np.linalg.solve(M, left.score)) - 0.5 * float(np.linalg.slogdet(M)[1])
