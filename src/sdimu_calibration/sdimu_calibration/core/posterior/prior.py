"""What is believed of the candidates before the data: how usual each is, and how large.

The number of effects that a model lacks is unknown: their rate is exponentially distributed with mean `MEAN_NUMBER`,
and each candidate has its share of it. Integrated over the rate,

    log pi(S) = sum_j log u_j + log k! - (n + 1) log(1 + b) + log b,   n = |S|,  b = 1 / MEAN_NUMBER,  sum u_j = 1

so that a sensor with k effects is likelier to have one more (k + 1 times the odds of the first one). Equations that no
physics names count in n alone: a sensor that has some is not likelier to have others. Several at once are more often
the parts of one function, which is tried by itself. Source: J. Scott, J. Berger, "Bayes and empirical-Bayes
multiplicity adjustment", Annals of Statistics 38 (2010).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from sdimu_calibration.core.arrays import Bools, Floats, Ints
from sdimu_calibration.core.effects.effect import OF_ONE_TIME, Effect
from sdimu_calibration.core.effects.selection import number_of
from sdimu_calibration.core.effects.usual import usual
from sdimu_calibration.core.evidence.candidate import Candidate
from sdimu_calibration.core.posterior.neighbours import odds_beside

MEAN_NUMBER = 2.0
"""Number of effects (1) that a model lacks, in the mean over sensors: real recordings showed between none and ten."""
KIN = 1.0
"""Log odds (1) of an effect that acts on one axis as one that is present acts on another: they have one cause."""
_FAULT = 0.05
"""Odds of a fault of one recording beside an effect of the sensor (1): one test in twenty has one."""
_OWN = 0.002
"""Odds of an equation that no physics names beside an effect of the catalogue (1): there are a thousand of them."""
WIDTHS = (1.0, 5.0, 50.0)
"""Sizes of an effect over the one-sigma size that physics gives it (1): of its class, out of it, broken."""
WIDTH_SHARES = (0.74, 0.24, 0.02)
"""Probability (1) of each of `WIDTHS`: one part in fifty is broken, one in four is out of its class."""
MOST_DRIFTS = 4
"""Number of drifts of one bias (1) that a model has at most: more of them follow any wander, and noise is that."""
_MOST_KEPT = 4000
"""Number of models (1) whose odds of one more are kept: 20 MB; a search asks for those of one model four times."""
_TWINS = 1e-8
"""Share (1) by which two signatures differ at most to be one: rounding; a difference of this size needs 5000 sigma."""
UNKNOWN_SIZE = 30.0
"""Size of an effect in the sigma that the data give it (1), where physics gives none: 3 to 300 is looked
for."""


@dataclass(frozen=True)
class Prior:
    """Prior of q candidates."""

    log_share: Floats
    """Shape (q,). Log of the share u of each (1); variants of a parameter share its odds."""
    cause: Ints
    """Candidates of one effect with the same time constant or the like share a number, shape (q,)."""
    parameter: Ints
    """Shape (q,). Variants of one parameter share a number: a model has one of them."""
    repeats: Bools
    """What happens at one time may happen at several, shape (q,)."""
    positive: Bools
    """The size cannot be negative, shape (q,)."""
    own: Bools
    """An equation that no physics names, shape (q,)."""
    drift: Ints
    """Shape (q,). Sensor axis whose bias a candidate lets drift, in all recordings or in one; -1 of all others."""
    twin: Ints
    """Shape (q,). Candidates that no data of this plan tell apart share a number: a model has one of them."""
    found: int = 0
    """Number of effects that the model as given has because they were found: they count with those of a model."""

    def of(self, places: Ints) -> Prior:
        """Prior of some of the candidates, as unlikely as they are among all of them.

        Parameters
        ----------
        places : ndarray of int, shape (k,)
        """
        return Prior(
            self.log_share[places],
            self.cause[places],
            self.parameter[places],
            self.repeats[places],
            self.positive[places],
            self.own[places],
            self.drift[places],
            self.twin[places],
            self.found,
        )

    @cached_property
    def of_one_sign(self) -> frozenset[int]:
        """Candidates whose size cannot be negative."""
        return frozenset(np.flatnonzero(self.positive).tolist())

    @cached_property
    def _bins(self) -> int:
        """Number of axes whose drifts are counted, and one for all that is no drift."""
        return int(self.drift.max(initial=-1)) + 2

    @cached_property
    def _alike(self) -> Ints:
        """What `odds_beside` compares, shape (q, 4)."""
        return np.ascontiguousarray(np.column_stack([self.parameter, self.twin, self.cause, self.drift]))

    @cached_property
    def _odds_beside(self) -> dict[tuple[int, ...], Floats]:
        return {}

    @cached_property
    def _known_odds(self) -> dict[int, Floats]:
        return {}

    def _next_one(self, named: int) -> Floats:
        """Log odds of each candidate as one more of a model with some effects that are no equations, shape (q,)."""
        if named not in self._known_odds:
            odds = self.log_share - np.log1p(1.0 / MEAN_NUMBER)
            odds[~self.own] += np.log(named + 1.0)
            self._known_odds[named] = odds
        return self._known_odds[named]

    def like(self, some: Sequence[int]) -> Bools:
        """Say which candidates no model has beside any of some: these, their twins, variants that exclude each other.

        Returns
        -------
        ndarray of bool, shape (q,)
        """
        at = np.asarray(some, dtype=np.int64)
        variants = np.isin(self.parameter, self.parameter[at]) & ~self.repeats
        return variants | np.isin(self.twin, self.twin[at])

    def named(self, base: Sequence[int]) -> int:
        """Count the effects that are no equations: candidates of a model, and those of the model as given."""
        return self.found + int(np.count_nonzero(~self.own[np.asarray(base, dtype=np.int64)]))

    def log_more(self, base: Sequence[int]) -> Floats:
        """Log odds of each candidate beside those of a model.

        Parameters
        ----------
        base : sequence of int
            Candidates of the model.

        Returns
        -------
        ndarray, shape (q,)
            Log (1), not to be written to; -inf for those that the model has already.
        """
        of_model, kept = tuple(sorted(base)), self._odds_beside
        odds = kept.get(of_model)
        if odds is None:
            if len(kept) >= _MOST_KEPT:
                kept.clear()
            members, next_one = np.array(of_model, dtype=np.int64), self._next_one(self.named(of_model))
            odds = odds_beside(next_one, self._alike, self.repeats, members, KIN, MOST_DRIFTS)
            odds.flags.writeable = False
            kept[of_model] = odds
        return odds

    def apart(self, base: Sequence[int], use: Ints) -> tuple[Ints, Ints]:
        """Say which pairs no model may hold: variants of one parameter, twins, more drifts of a bias than allowed.

        Parameters
        ----------
        base : sequence of int
            Candidates of the model.
        use : ndarray of int, shape (u,)
            Candidates of which each alone may stand beside it.

        Returns
        -------
        apart : ndarray of int, shape (u, 3)
            Two that share a number in one column exclude each other.
        kin : ndarray of int, shape (u,)
            Two that share a number have one cause that the model has not: they have the odds of kin.
        """
        at = np.asarray(base, dtype=np.int64)
        counted = np.bincount(self.drift[at] + 1, minlength=self._bins)
        full = (counted[self.drift[use] + 1] == MOST_DRIFTS - 1) & (self.drift[use] >= 0)
        nobody = -1 - np.arange(len(use))
        apart = [
            np.where(self.repeats[use], nobody, self.parameter[use]),
            self.twin[use],
            np.where(full, self.drift[use], nobody),
        ]
        kin = np.where(np.isin(self.cause[use], self.cause[at]), nobody, self.cause[use])
        return np.column_stack(apart), kin

    def log_of(self, chosen: Sequence[int]) -> float:
        """Log of the prior of a set of candidates, over that of none (1); -inf for a set that no model may be."""
        at, count = np.asarray(chosen, dtype=np.int64), len(chosen)
        if not count:
            return 0.0
        own = at[~self.repeats[at]]
        drifts = np.bincount(self.drift[at] + 1, minlength=self._bins)[1:]
        distinct = [len(set(one.tolist())) == len(one) for one in (at, self.parameter[own], self.twin[at])]
        if not all(distinct) or drifts.max(initial=0) > MOST_DRIFTS:
            return -np.inf
        kin = count - len(set(self.cause[at].tolist()))
        number = float(np.log(np.arange(self.found + 1.0, self.named(at.tolist()) + 1.0)).sum())
        number -= count * float(np.log1p(1.0 / MEAN_NUMBER))
        return float(self.log_share[at].sum()) + number + KIN * kin


def prior_of(
    candidates: Sequence[Candidate], shared: Sequence[int] = (), J: Floats | None = None, found: Sequence[Effect] = ()
) -> Prior:
    """State the prior of candidates.

    Parameters
    ----------
    candidates : sequence of Candidate, length q
    shared : sequence of int
        Places of candidates that were made from another one between those of a scan: they have its odds, and do not
        lower those of the others.
    J : ndarray, shape (q, q), optional
        Information on the candidates, the coefficients taken out, in any units: tells which are twins.
    found : sequence of Effect
        Effects of the model as given that were found: the odds are those beside them.
    """
    names = [c.coefficient for c in candidates]
    made = set(shared)
    count = Counter(name for k, name in enumerate(names) if k not in made)
    weight = np.array([_odds(c) / max(count[name], 1) for c, name in zip(candidates, names, strict=True)])
    total = float(sum(w for k, w in enumerate(weight.tolist()) if k not in made and candidates[k].family != "own"))
    causes = [(c.label,) if c.family == "own" else tuple(c.effect.options.values()) for c in candidates]
    # What has a cause that the model has is kin of that, and not once more of others of this cause.
    have = {("", one.family or one.name, *one.options.values()) for one in found}
    keys = [(c.recording, c.family, *cause) for c, cause in zip(candidates, causes, strict=True)]
    kin = np.array([key in have for key in keys], dtype=bool)
    axes = _numbers([(c.recording, str(c.effect.terms[0].channel)) for c in candidates])
    return Prior(
        np.log(weight / max(total, 1e-300)) + KIN * kin,
        _numbers([(*key, str(k)) if kin[k] else key for k, key in enumerate(keys)]),
        _numbers([(name,) for name in names]),
        np.array([bool(OF_ONE_TIME & c.effect.options.keys()) for c in candidates], dtype=bool),
        np.array([c.effect.positive for c in candidates], dtype=bool),
        np.array([c.family == "own" for c in candidates], dtype=bool),
        np.where([c.effect.bias_drift for c in candidates], axes, -1).astype(np.int64),
        np.arange(len(names)) if J is None else twins(J),
        number_of(found),
    )


def twins(J: Floats) -> Ints:
    """Give candidates of one signature the same number.

    A delay of a gyro and its sensitivity to angular acceleration are one: ``w(t - tau) = w - tau dw/dt``.

    Parameters
    ----------
    J : ndarray, shape (q, q)
        Information on the candidates, the coefficients taken out, in any units.

    Returns
    -------
    ndarray of int, shape (q,)
        The first of each group.
    """
    size = np.sqrt(np.maximum(np.diag(J), 1e-300))
    same = np.abs(J) > (1.0 - _TWINS) * np.outer(size, size)
    return np.asarray(np.argmax(same, axis=1))


def _odds(candidate: Candidate) -> float:
    if candidate.family == "own":
        return _OWN
    return usual(candidate.family) * (_FAULT if candidate.effect.scope == "recording" else 1.0)


def _numbers(keys: Sequence[tuple[str, ...]]) -> Ints:
    known: dict[tuple[str, ...], int] = {}
    return np.array([known.setdefault(key, len(known)) for key in keys], dtype=np.int64)
