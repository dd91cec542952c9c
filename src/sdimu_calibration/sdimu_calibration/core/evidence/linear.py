"""A linear model of one recording about a calibration: what every search for a missing effect works on.

Whoever calibrated, by navigation or by hand, leaves whitened residuals and says how one unit of each parameter shows in
them. Everything that follows from that is least squares and knows neither.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import InitVar, dataclass, field, replace
from functools import cached_property
from typing import TypeVar

import numpy as np

from sdimu_calibration.core.arrays import Floats, Ints
from sdimu_calibration.core.effects.effect import Effect, Timetable
from sdimu_calibration.core.effects.imu_model import prior_size
from sdimu_calibration.core.evidence.attitude_functions import AttitudeFunctions
from sdimu_calibration.core.evidence.candidate import Candidate, split
from sdimu_calibration.core.evidence.conditions import Conditions
from sdimu_calibration.core.evidence.in_stops import InStops
from sdimu_calibration.core.evidence.information import Information
from sdimu_calibration.core.evidence.inner_noise import InnerNoise
from sdimu_calibration.core.evidence.noise_kernels import Stretches, stretch_effects
from sdimu_calibration.core.evidence.taken import divided, factor
from sdimu_calibration.core.side_by_side import side_by_side
from sdimu_calibration.core.specification import ImuSpecification

_BLOCK = 150
"""Number of columns that are multiplied at a time: their products with those behind them are the same, turned."""
E = TypeVar("E", bound="LinearEvidence")


@dataclass(frozen=True)
class LinearEvidence(ABC):
    """Whitened residuals ``e = W theta + white noise``, theta the deviation from the calibration.

    Noise with a memory that was learned stands beside: ``e = W theta + noise u + white noise``, u of unit variance.
    """

    e: Floats
    """Whitened residuals with all parameters at the calibration's values, shape (N,)."""
    W: Floats
    """Shape (N, p + q). Signatures, whitened residual per SI unit: p parameters of the model, then q candidates."""
    stop: Ints
    """Shape (N,). Number of the stop that each row belongs to: rows of one stop are left out together."""
    names: tuple[str, ...]
    """Of the p + q parameters."""
    weight: Floats
    """Prior information of the model's parameters (1/sigma^2), shape (p,)."""
    shift: Floats
    """Prior mean minus the calibration's values, shape (p,)."""
    stated: Floats
    """One-sigma of the model's parameters by the specification, whatever the calibration had to widen it to,
    shape (p,)."""
    candidates: tuple[Candidate, ...]
    """Length q."""
    prior: Floats
    """One-sigma that physics gives the candidates (inf where unknown), shape (q,)."""
    imu: ImuSpecification
    """Gives candidates their prior."""
    times: Timetable
    """When the recording stood and turned."""
    coefficients: int
    """How many of the model's parameters, the first ones, are sensor coefficients."""
    noise: InStops | None = field(default=None, kw_only=True)
    """Signatures of the modes of noise with a memory, N rows and r columns; None without any."""
    found: tuple[Effect, ...] = field(default=(), kw_only=True)
    """Effects of the catalogue that came to the model because they were found: a sensor that has some is likelier to
    have more."""
    inner: InnerNoise | None = field(default=None, kw_only=True)
    """Noise that moves within stretches, in which all rows are whitened; None where white noise alone is there."""
    worked_out: InitVar[Information | None] = field(default=None, kw_only=True)
    """`information`, where whoever makes the evidence knows it more cheaply; evidence made from this one has its own.
    """

    def __post_init__(self, worked_out: Information | None) -> None:
        """Keep the information that is known."""
        if worked_out is not None:
            object.__setattr__(self, "information", worked_out)

    @abstractmethod
    def signature(self, effects: Sequence[Effect]) -> Floats:
        """Signatures of all parameters of some effects.

        Returns
        -------
        ndarray, shape (N, parameters)
            Change of each whitened residual per SI unit of each parameter, effect by effect.
        """

    @property
    def row_times(self) -> Floats | None:
        """Time at the end of what each row measures (s), shape (N,); None where rows have none."""
        return None

    def in_inner(self: E, inner: InnerNoise | None) -> E:
        """Return an evidence of white noise whitened in noise that moves within stretches.

        Raises
        ------
        ValueError
            Of an evidence that is whitened in another one.
        """
        if inner is None or self.inner is inner:
            return self
        if self.inner is not None:
            raise ValueError("an evidence is whitened in what moves within stretches once")
        return replace(self, e=inner.whitened(self.e), W=inner.whitened(self.W), inner=inner)

    def conditions(self, cut: Stretches) -> Conditions | None:
        """Give what an unknown error may follow in each stretch; None where nobody knows it."""
        del cut
        return None

    def attitude_functions(self) -> AttitudeFunctions | None:
        """Give functions of the attitude for the test; None where nobody knows it in every sample."""
        return None

    def constant_signature(self, cut: Stretches) -> Floats:
        """Signatures of a constant error of each sensor axis in each stretch.

        Parameters
        ----------
        cut : Stretches
            s stretches.

        Returns
        -------
        ndarray, shape (N, 6 s)
            Change of each whitened residual per rad/s or m/s^2; column ``6 stretch + axis``.
        """
        return self.signature(stretch_effects(cut))

    @property
    def model(self) -> Ints:
        """Columns of the model's own parameters, shape (p,)."""
        return np.arange(len(self.weight))

    @property
    def unpredictable(self) -> float:
        """Variance of a prediction, over that of the measurement, from which a row left out is not counted."""
        return float("inf")

    @cached_property
    def information(self) -> Information:
        """Information on all parameters, ``J = W' S^-1 W`` with S the covariance of all noise.

        J holds the data alone. d holds ``W' S^-1 e`` and, for the model's parameters, ``weight * shift``: the pull of
        their prior.
        """
        d = self.W.T @ self.residuals
        d[: len(self.weight)] += self.weight * self.shift
        return Information(self.W.T @ self.weighed(self.W), d)

    @property
    def residuals(self) -> Floats:
        """Residuals weighed with the inverse covariance of all noise, shape (N,)."""
        return self.weighed(self.e[:, None])[:, 0]

    def weighed(self, columns: Floats) -> Floats:
        """Weigh columns with the inverse covariance of all noise, ``(I + noise noise')^-1``.

        Parameters
        ----------
        columns : ndarray, shape (N, k)
            In the units of W or e.

        Returns
        -------
        ndarray, shape (N, k)
            By the matrix inversion lemma, in the number of modes; in the same units.
        """
        if self.noise is None:
            return columns
        Z = divided(self._noise_factor, self.noise.across(columns))
        return np.asarray(columns - self.noise.times(divided(self._noise_factor, Z.T, turned=True)))

    @cached_property
    def _noise_factor(self) -> Floats:
        """Cholesky factor of the information on the modes of the noise, shape (r, r)."""
        square = np.zeros((0, 0)) if self.noise is None else self.noise.square
        return factor(np.eye(len(square)) + square)

    def with_noise(self: E, modes: InStops | None, worked_out: Information | None = None) -> E:
        """Return the evidence with other modes of noise with a memory.

        Parameters
        ----------
        modes : InStops, optional
            Signatures of the modes in the whitened residuals, each of unit variance; None for white noise.
        worked_out : Information, optional
            In that noise.
        """
        return self if modes is None and self.noise is None else replace(self, noise=modes, worked_out=worked_out)

    def with_effects(self: E, effects: Sequence[Effect], signature: Floats | None = None) -> E:
        """Return the evidence with the parameters of more effects behind the candidates it has.

        Parameters
        ----------
        signature : ndarray, shape (N, parameters), optional
            Of these effects, where it is known (whitened residual per SI unit).
        """
        more, prior = candidate_priors(effects, self.imu)
        W = self.signature(effects) if signature is None else signature
        # Only what is new is multiplied: the old columns are many.
        weighed, every, old = self.weighed(W), np.hstack([self.W, W]), self.information
        q = len(old.d)
        J = np.empty((every.shape[1], every.shape[1]))
        J[:q, :q] = old.J

        def fill(begin: int) -> None:
            end = min(begin + _BLOCK, W.shape[1])
            J[: q + end, q + begin : q + end] = every[:, : q + end].T @ weighed[:, begin:end]
            J[q + begin : q + end, : q + end] = J[: q + end, q + begin : q + end].T

        side_by_side(fill, range(0, W.shape[1], _BLOCK))
        return replace(
            self,
            W=every,
            names=(*self.names, *(c.label for c in more)),
            candidates=(*self.candidates, *more),
            prior=np.concatenate([self.prior, prior]),
            worked_out=Information(J, np.concatenate([old.d, weighed.T @ self.e])),
        )

    def candidate(self, column: int) -> Candidate:
        """Candidate of a column of W that is none of the model's."""
        return self.candidates[column - len(self.weight)]

    def only(self: E, columns: Ints) -> E:
        """Return the evidence with the model and some of the candidates alone.

        Parameters
        ----------
        columns : ndarray of int, shape (k,)
            Columns of W that are candidates; they come in this order.
        """
        p = len(self.weight)
        keep = np.concatenate([self.model, columns]).astype(np.int64)
        whole = np.array_equal(keep, np.arange(len(keep)))
        full = self.information
        return replace(
            self,
            W=self.W[:, : len(keep)] if whole else _chosen(self.W, keep),
            names=tuple(self.names[i] for i in keep),
            candidates=tuple(self.candidate(i) for i in columns),
            prior=self.prior[columns - p],
            worked_out=Information(full.J[np.ix_(keep, keep)], full.d[keep]),
        )

    def about(self: E, fresh: E, columns: Ints, tried: Sequence[Candidate]) -> E:
        """Return this evidence about another fit: its residuals and priors with the signatures as they are.

        Signatures change with the point by their share of the sensor errors, parts in a thousand of what they are.
        What is exact are the residuals, so that repeated fits end where their own signatures would end.

        Parameters
        ----------
        fresh : LinearEvidence
            About the other fit, with no candidates.
        columns : ndarray of int, shape (k,)
            Coefficients of the model of that fit which are candidates here.
        tried : sequence of Candidate, length k
            The same as candidates.
        """
        p, labels = len(self.weight), [c.label for c in self.candidates]
        places = [p + labels.index(c.label) for c in tried]
        stays = np.setdiff1d(fresh.model, columns)
        e = fresh.e - self.W[:, places] @ fresh.shift[columns]
        weight, shift = fresh.weight[stays], fresh.shift[stays]
        d = self.W.T @ e
        d[:p] += weight * shift
        return replace(
            fresh,
            e=e,
            W=self.W,
            names=self.names,
            weight=weight,
            shift=shift,
            stated=fresh.stated[stays],
            candidates=self.candidates,
            prior=self.prior,
            coefficients=self.coefficients,
            found=self.found,
            worked_out=Information(self.information.J, d),
        )

    def as_candidates(self: E, columns: Ints, tried: Sequence[Candidate]) -> E:
        """Make candidates of coefficients of the model, as if the calibration had not known them.

        The residuals are those of a model that has the coefficients at their estimates; in the linear model they were
        larger by the signature times the estimate without.

        Parameters
        ----------
        columns : ndarray of int, shape (k,)
            Coefficients of the model.
        tried : sequence of Candidate, length k
            The same as candidates; they come before the others.
        """
        if not len(columns):
            return self
        p = len(self.weight)
        stays = np.setdiff1d(self.model, columns)
        order = np.concatenate([stays, columns, np.arange(p, len(self.names))]).astype(np.int64)
        # Not the prior that the calibration had: it was widened where the data contradicted it.
        _, prior = candidate_priors([c.effect for c in tried], self.imu)
        return replace(
            self,
            e=self.e - self.W[:, columns] @ self.shift[columns],
            W=_chosen(self.W, order),
            names=(*(self.names[i] for i in stays), *(c.label for c in tried), *self.names[p:]),
            weight=self.weight[stays],
            shift=self.shift[stays],
            stated=self.stated[stays],
            candidates=(*tried, *self.candidates),
            prior=np.concatenate([prior, self.prior]),
            coefficients=self.coefficients - len(columns),
            found=_without(self.found, tried),
        )


def _without(found: Sequence[Effect], tried: Sequence[Candidate]) -> tuple[Effect, ...]:
    """Leave out of effects those that are candidates."""
    labels = {label for one in tried for label in one.effect.labels}
    return tuple(effect for effect in found if labels.isdisjoint(effect.labels))


def candidate_priors(effects: Sequence[Effect], imu: ImuSpecification) -> tuple[tuple[Candidate, ...], Floats]:
    """Split effects into candidates, one a parameter, with the size that physics gives each.

    Returns
    -------
    candidates : tuple of Candidate, length q
    prior : ndarray, shape (q,)
        One-sigma (SI): of the IMU's file, else of its grade; inf where neither has it.
    """
    candidates = tuple(c for effect in effects for c in split(effect))
    sizes = [prior_size(c.effect, imu) for c in candidates]
    return candidates, np.array([np.inf if size is None else size for size in sizes])


def _chosen(W: Floats, columns: Ints) -> Floats:
    """Copy some columns of a matrix, each in one piece of memory, as W has them."""
    return np.take(W.T, columns, axis=0).T
