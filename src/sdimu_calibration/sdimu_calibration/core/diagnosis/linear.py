"""A linear model of one recording about a calibration: what every search for a missing effect works on.

Whoever calibrated, by navigation or by hand, leaves whitened residuals and says how one unit of each parameter shows in
them. Everything that follows from that is least squares and knows neither.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TypeVar

import numpy as np

from sdimu_calibration.core.arrays import Floats, Ints
from sdimu_calibration.core.diagnosis.candidates import Candidate, split
from sdimu_calibration.core.diagnosis.information import Information
from sdimu_calibration.core.effects.effect import Effect

E = TypeVar("E", bound="LinearEvidence")


@dataclass(frozen=True)
class LinearEvidence(ABC):
    """Whitened residuals ``e = W theta + white noise``, theta the deviation from the calibration.

    Attributes
    ----------
    e : ndarray, shape (N,)
        Whitened residuals with all parameters at the calibration's values.
    W : ndarray, shape (N, p + q)
        Signatures: p parameters of the model, then q candidates.
    stop : ndarray of int, shape (N,)
        Of each row: rows of one stop are left out together.
    names : tuple of str
        Of the p + q parameters.
    weight : ndarray, shape (p,)
        Prior information of the model's parameters (1/sigma^2).
    shift : ndarray, shape (p,)
        Prior mean minus the calibration's values.
    stated : ndarray, shape (p,)
        One-sigma of the model's parameters by the specification, whatever the calibration had to widen it to.
    candidates : tuple of Candidate, length q
    prior : ndarray, shape (q,)
        One-sigma that physics gives the candidates (inf where unknown).
    grade : str
        Of the IMU: gives candidates their prior.
    """

    e: Floats
    W: Floats
    stop: Ints
    names: tuple[str, ...]
    weight: Floats
    shift: Floats
    stated: Floats
    candidates: tuple[Candidate, ...]
    prior: Floats
    grade: str

    @abstractmethod
    def signature(self, effects: Sequence[Effect]) -> Floats:
        """Columns of all parameters of `effects`, shape (N, parameters)."""

    @property
    def model(self) -> Ints:
        """Indices of the model's own parameters."""
        return np.arange(len(self.weight))

    @property
    def coefficients(self) -> int:
        """How many of the model's parameters, the first ones, are sensor coefficients."""
        return len(self.weight)

    @property
    def unpredictable(self) -> float:
        """Variance of a prediction, over that of the measurement, from which a row left out is not counted."""
        return float("inf")

    @cached_property
    def information(self) -> Information:
        """Information on all parameters, the prior's pull on the model's in d."""
        d = self.W.T @ self.e
        d[: len(self.weight)] += self.weight * self.shift
        return Information(self.W.T @ self.W, d)

    def with_effects(self: E, effects: Sequence[Effect]) -> E:
        """Return the evidence with the parameters of more effects behind the candidates it has."""
        more = [c for effect in effects for c in split(effect)]
        W = self.signature(effects)
        wider = replace(
            self, W=np.hstack([self.W, W]), names=(*self.names, *(c.label for c in more)),
            candidates=(*self.candidates, *more),
            prior=np.concatenate([self.prior, [c.effect.prior.get(self.grade, np.inf) for c in more]]),
        )  # fmt: skip
        # Only what is new is multiplied: the old columns are many.
        old, across = self.information, self.W.T @ W
        J = np.block([[old.J, across], [across.T, W.T @ W]])
        wider.__dict__["information"] = Information(J, np.concatenate([old.d, W.T @ self.e]))
        return wider

    def only(self: E, columns: Ints) -> E:
        """Return the evidence with the model and the candidates at `columns` alone."""
        p = len(self.weight)
        keep = np.concatenate([self.model, columns]).astype(np.int64)
        whole = np.array_equal(keep, np.arange(len(keep)))
        part = replace(
            self, W=self.W[:, : len(keep)] if whole else self.W[:, keep], names=tuple(self.names[i] for i in keep),
            candidates=tuple(self.candidates[i - p] for i in columns), prior=self.prior[columns - p],
        )  # fmt: skip
        full = self.information
        part.__dict__["information"] = Information(full.J[np.ix_(keep, keep)], full.d[keep])
        return part
