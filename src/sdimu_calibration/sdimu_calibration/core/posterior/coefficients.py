"""Coefficients of the sensors over all models that the data leave probable: their mean and covariance.

    mean = sum_m w_m theta_m,   C = sum_m w_m (C_m + (theta_m - mean)(theta_m - mean)')

Each coefficient means the same in all models: a bias is that in the mean over the dwells, with whatever drifts or
wanders there; a drift of one recording of a set alone is none of the unit. Source: J. Hoeting et al., "Bayesian model
averaging: a tutorial", Statistical Science 14 (1999).

An equation that no physics names shows what residuals look like, and not what its cause adds to the coefficients: with
one probability it moves them as the equation does. With the other it does not, and another cause adds as much to the
coefficients of that sensor as is seen of it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from sdimu_calibration.core.arrays import Floats, Ints
from sdimu_calibration.core.effects import bias
from sdimu_calibration.core.effects.effect import Effect
from sdimu_calibration.core.effects.selection import resolve
from sdimu_calibration.core.evidence.candidate import Candidate
from sdimu_calibration.core.evidence.information import solved
from sdimu_calibration.core.evidence.linear import E
from sdimu_calibration.core.evidence.taken import divided
from sdimu_calibration.core.posterior.board import Board
from sdimu_calibration.core.posterior.models import Expansion, Members
from sdimu_calibration.core.posterior.noise_models import NoiseModel
from sdimu_calibration.core.posterior.posterior import Posterior, Weighed
from sdimu_calibration.core.posterior.prior import WIDTHS
from sdimu_calibration.core.posterior.search import WINDOW
from sdimu_calibration.core.recording import DataError

_MOST = 600
"""Number of models (1) averaged at most: with four hundred behind the likeliest probabilities scatter by .025."""
_LIKELIEST = 200
"""Number of models (1) that are averaged with their own weights: the others of `_MOST` stand for all that follow."""
_BESIDE = 40
"""Number of models (1) beside which the probability of what no averaged model holds is taken: the likeliest, which are
nearly alike in what they lack."""
_LEAST_LACKING = 1e-4
"""Probability (1) of a candidate that the averaged models lack, below which it is left out: a tenth of the least of a
model in a window."""
_IS_THE_CAUSE = 0.5
"""Probability (1) that an equation that no physics names moves the coefficients as its cause does: nothing in the data
says so, nothing speaks against it."""


@dataclass(frozen=True)
class Moments:
    """Deviation of the q coefficients from the calibration about which all is linear."""

    mean: Floats
    """SI, shape (q,)."""
    covariance: Floats
    """Shape (q, q)."""


@dataclass(frozen=True)
class _Mean:
    """What a noise adds to the biases in the mean over the dwells."""

    moved: Floats
    """What it takes off per unit of each parameter (SI), shape (6, p + u)."""
    mean: Floats
    """Shape (6,)."""
    covariance: Floats
    """Shape (6, 6)."""


@dataclass(frozen=True)
class _Beside:
    """Candidates beside a model, each by itself: whether one is there, of which width, and how large."""

    probability: Floats
    """With each width (1), shape (u, widths); zero of what is in the model."""
    size: Floats
    """In prior sizes (1), shape (u, widths)."""
    variance: Floats
    """(1), shape (u, widths)."""

    @classmethod
    def of(cls, near: Expansion) -> _Beside:
        """Work it out in closed form, of what is less than the window behind the model.

        Equations that no physics names are left out: what they add to the coefficients nobody knows.
        """
        variance = 1.0 / (near.c[:, None] + np.array(WIDTHS) ** -2.0)
        size = near.r[:, None] * variance
        gains = np.where(near.data.prior.own[:, None] | ~near.stands(size), -np.inf, near.gains())
        # Of the likelier of being there and not: the other one's odds are no number where it is certain.
        top = np.maximum(gains.max(axis=1, keepdims=True), 0.0)
        odds = np.where(gains > -WINDOW, np.exp(gains - top), 0.0)
        return cls(odds / (np.exp(-top) + odds.sum(axis=1, keepdims=True)), size, variance)

    def moments(self, some: Ints) -> tuple[Floats, Floats]:
        """First and second moment of the sizes of some candidates, zero where they are not there; (1), shape (k,)."""
        p, size = self.probability[some], self.size[some]
        return (p * size).sum(axis=1), (p * (size**2 + self.variance[some])).sum(axis=1)


class Averages:
    """Moments of the coefficients in the models of a posterior.

    Parameters
    ----------
    dwell_means : callable
        Mean of the regressors of an effect over all dwells (SI), shape (terms,).
    """

    def __init__(self, board: Board[E], dwell_means: Callable[[Effect], Floats]) -> None:
        self.board = board
        self._dwell_means = dwell_means
        self._means: dict[int, Floats] = {}
        self._noises: dict[NoiseModel, _Mean] = {}

    def of_model(self, members: Members, noise: NoiseModel, as_told: bool = True) -> Moments:
        """Moments in one model.

        Parameters
        ----------
        as_told : bool
            Equations that no physics names are the cause; else they may stand for another one.
        """
        data, one = self.board.in_noise(noise), self._mean(noise)
        p, q = len(self.board.evidence.weight), self.board.evidence.coefficients
        at, covariance = self._parameters(members, noise)
        estimate = covariance @ data.d[at]
        T = self._coefficients(members, noise)
        constant, own = np.zeros(q), np.zeros((q, q))
        for channel, row in self._biases.items():
            constant[row] = one.mean[channel]
            for other, column in self._biases.items():
                own[row, column] = one.covariance[channel, other]
        told = Moments(T @ estimate + constant, T @ covariance @ T.T + own)
        equations = {
            place: one.effect.terms[0].channel
            for place, one in enumerate((self._candidate(number) for number, _ in members), start=p)
            if one.family == "own"
        }
        if as_told or not equations:
            return told
        # What the coefficients are off by where the sizes of all equations are zero, and all else stays.
        moved = T @ covariance[:, list(equations)] @ _inverse_times(list(equations), covariance, estimate)
        hidden = np.zeros(q)
        for channel in sorted(set(equations.values())):
            of_sensor = [place for place, other in equations.items() if other == channel]
            seen = float(estimate[of_sensor] @ _inverse_times(of_sensor, covariance, estimate))
            hidden += self._out_of_sight(channel, seen, data.J)
        return _with_another_cause(told, moved, hidden)

    def _parameters(self, members: Members, noise: NoiseModel) -> tuple[Ints, Floats]:
        """Give the columns of the parameters of a model in its noise (k,), and their covariance (k, k), SI."""
        p = len(self.board.evidence.weight)
        at = np.array([*range(p), *(p + k for k, _ in members)], dtype=np.int64)
        information = self.board.in_noise(noise).J[np.ix_(at, at)] + np.diag(self.board.parameters(members)[1])
        return at, solved(information, np.eye(len(at)))

    def _coefficients(self, members: Members, noise: NoiseModel) -> Floats:
        """Take the parameters of a model to the q coefficients, a bias as its mean over the dwells; shape (q, k)."""
        p, q = len(self.board.evidence.weight), self.board.evidence.coefficients
        at = [*range(p), *(p + k for k, _ in members)]
        T = np.eye(q, len(at))
        for channel, row in self._biases.items():
            T[row] -= self._mean(noise).moved[channel, at]
        for place, (number, _) in enumerate(members, start=p):
            T[:, place] += self._shift(number)
        return T

    @cached_property
    def _biases(self) -> dict[int, int]:
        """Row of the bias of each channel among the coefficients."""
        names = self.board.evidence.names[: self.board.evidence.coefficients]
        return {c: names.index(name) for c, name in enumerate(bias.NAMES) if name in names}

    def _out_of_sight(self, channel: int, seen: float, J: Floats) -> Floats:
        """Variance of what another cause in the place of equations of a sensor adds to its coefficients.

        As much as is seen of it, in equal parts.

        Parameters
        ----------
        seen : float
            Squared significance of these equations together (1).
        J : ndarray, shape (k, k)
            Information of each column alone, those of the q coefficients first (1/SI^2).

        Returns
        -------
        ndarray, shape (q,)
            SI squared; zero for the coefficients of other sensors.
        """
        names = self.board.evidence.names[: self.board.evidence.coefficients]
        at = [k for k, name in enumerate(names) if channel_of(name) == channel and J[k, k] > 0.0]
        out = np.zeros(len(names))
        out[at] = seen / len(at) / np.diag(J)[at] if at else 0.0
        return out

    def of(self, found: Posterior[E]) -> Moments:
        """Moments over all models."""
        models, weight = averaged(found.models)
        each = [self.of_model(m.members, m.noise, as_told=False) for m in models]
        means = np.array([one.mean for one in each])
        mean = weight @ means
        apart = means - mean
        within = np.einsum("m,mij->ij", weight, np.array([one.covariance for one in each]))
        left_out = self._left_out(models, weight)
        return Moments(mean + left_out.mean, within + (weight[:, None] * apart).T @ apart + left_out.covariance)

    def _left_out(self, models: Sequence[Weighed], weight: Floats) -> Moments:
        """Say what candidates add to the moments by the part of their probability that some models lack.

        A window holds what is improbable beside each of its models too seldom: it looks at the neighbours of the
        likeliest alone. Its probability beside these is known in closed form.

        Parameters
        ----------
        models : sequence of Weighed
            That are averaged.
        weight : ndarray, shape (models,)
            Of each (1).
        """
        q, held = self.board.evidence.coefficients, np.zeros(len(self.board.use))
        for model, w in zip(models, weight.tolist(), strict=True):
            held[[k for k, _ in model.members]] += w
        models, likely = models[:_BESIDE], weight[:_BESIDE] / weight[:_BESIDE].sum()
        beside = [_Beside.of(self.board.data(m.noise)[1].at(m.members)) for m in models]
        probability = np.array([w * one.probability.sum(axis=1) for w, one in zip(likely, beside, strict=True)])
        total = probability.sum(axis=0)
        lacks = np.maximum(total - held, 0.0)
        some = np.flatnonzero(lacks > _LEAST_LACKING)
        share = lacks[some] / total[some]
        mean, covariance = np.zeros(q), np.zeros((q, q))
        if not len(some):
            return Moments(mean, covariance)
        for model, w, one in zip(models, likely.tolist(), beside, strict=True):
            moved = self._moved_by(some, model) * self.board.size[some]
            first, second = one.moments(some)
            mean += w * moved @ (share * first)
            covariance += w * (moved * (share * second)) @ moved.T
        return Moments(mean, covariance)

    def _moved_by(self, some: Ints, model: Weighed) -> Floats:
        """Give the change of the q coefficients per unit of some candidates beside a model, shape (q, candidates)."""
        at, covariance = self._parameters(model.members, model.noise)
        columns = len(self.board.evidence.weight) + some
        J = self.board.in_noise(model.noise).J
        out = -self._coefficients(model.members, model.noise) @ (covariance @ J[np.ix_(at, columns)])
        for channel, row in self._biases.items():
            out[row] -= self._mean(model.noise).moved[channel, columns]
        return np.asarray(out + np.column_stack([self._shift(k) for k in some.tolist()]))

    def _shift(self, number: int) -> Floats:
        """Mean over the dwells that a candidate adds to each of q coefficients, per unit; shape (q,)."""
        if number not in self._means:
            evidence, candidate = self.board.evidence, self._candidate(number)
            names = evidence.names[: evidence.coefficients]
            mean = drift_mean(candidate.effect, self._dwell_means, names)
            # A drift of one recording of a set is none of the unit.
            self._means[number] = np.zeros_like(mean) if candidate.recording else mean
        return self._means[number]

    def _candidate(self, number: int) -> Candidate:
        return self.board.evidence.candidate(int(self.board.use[number]))

    def _mean(self, noise: NoiseModel) -> _Mean:
        if noise not in self._noises:
            one, wander = self.board.in_noise(noise), self.board.wander
            if wander is None or not one.R.size:
                self._noises[noise] = _Mean(np.zeros((6, len(self.board.keep))), np.zeros(6), np.zeros((6, 6)))
            else:
                cut = wander.cut
                G = np.einsum("s,scr->cr", cut.in_dwells, one.R.reshape(cut.cells, 6, -1))
                H = divided(one.modes.L, G)
                self._noises[noise] = _Mean(H.T @ one.modes.Z, H.T @ one.modes.z, H.T @ H)
        return self._noises[noise]


def averaged(models: Sequence[Weighed]) -> tuple[list[Weighed], Floats]:
    """Choose models that stand for all of a window, each with its weight.

    With many effects open a window holds ten thousand models. A step that had come at another time with a twentieth was
    in hardly any of the likeliest, and a bias was seven sigma off. Models behind these are taken at equal steps of the
    sum of their probabilities, so that each effect keeps its own but for the scatter of a sample: W. Madow, "On the
    theory of systematic sampling, II", Annals of Mathematical Statistics 20 (1949).

    Parameters
    ----------
    models : sequence of Weighed
        The likeliest first.

    Returns
    -------
    models : list of Weighed, length k
        `_MOST` at most, the likeliest first.
    weight : ndarray, shape (k,)
        Of each (1), one in all.
    """
    weight = np.array([m.probability for m in models])
    chosen = np.arange(len(models))
    if len(models) > _MOST:
        # Models alike stand side by side, so that each set of effects has its share.
        behind = sorted(range(_LIKELIEST, len(models)), key=lambda k: ([n for n, _ in models[k].members], k))
        passed = np.cumsum(weight[behind])
        step = passed[-1] / (_MOST - _LIKELIEST)
        at = np.searchsorted(passed, step * (0.5 + np.arange(_MOST - _LIKELIEST)))
        taken, times = np.unique(np.minimum(at, len(behind) - 1), return_counts=True)
        order = np.argsort(taken_at := np.array(behind)[taken])
        chosen = np.concatenate([np.arange(_LIKELIEST), taken_at[order]])
        weight = np.concatenate([weight[:_LIKELIEST], step * times[order]])
    return [models[k] for k in chosen.tolist()], weight / weight.sum()


def _inverse_times(at: Sequence[int], covariance: Floats, estimate: Floats) -> Floats:
    """Inverse of the covariance of some parameters times their estimates, per SI unit of each, shape (k,)."""
    return np.asarray(np.linalg.solve(covariance[np.ix_(at, at)], estimate[list(at)]))


def _with_another_cause(told: Moments, moved: Floats, hidden: Floats) -> Moments:
    """Mix a model with equations, and one in which other causes stand in the place of all of them.

    Parameters
    ----------
    moved : ndarray, shape (q,)
        What the equations add to each coefficient (SI).
    hidden : ndarray, shape (q,)
        Variance of what the other causes add (SI squared).
    """
    p = _IS_THE_CAUSE
    spread = p * (1.0 - p) * np.outer(moved, moved) + (1.0 - p) * np.diag(hidden)
    return Moments(told.mean - (1.0 - p) * moved, told.covariance + spread)


@lru_cache(maxsize=1024)
def channel_of(name: str) -> int | None:
    """Sensor axis that a coefficient acts on, 0 to 5; None for one that the catalogue does not know."""
    try:
        return resolve(name).terms[0].channel
    except DataError:
        return None


def drift_mean(effect: Effect, dwell_means: Callable[[Effect], Floats], names: Sequence[str]) -> Floats:
    """Mean over the dwells that a drift of a bias adds to it, per unit of the drift.

    Parameters
    ----------
    dwell_means : callable
        Mean of the regressors of an effect over all dwells (SI), shape (terms,).
    names : sequence of str, length q
        Coefficients.

    Returns
    -------
    ndarray, shape (q,)
        In the unit of the coefficient over that of the effect (SI); zero where it is no bias, and of no drift.
    """
    out = np.zeros(len(names))
    if effect.bias_drift:
        for mean, term in zip(dwell_means(effect).tolist(), effect.terms, strict=True):
            if bias.NAMES[term.channel] in names:
                out[names.index(bias.NAMES[term.channel])] += mean
    return out
