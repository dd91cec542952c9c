"""What data so far know of the coefficients of a unit, for a plan or a recording that comes next."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sdimu_calibration.core.arrays import Floats, Ints
from sdimu_calibration.core.effects import body_frame
from sdimu_calibration.core.effects.effect import OF_ONE_TIME, Effect
from sdimu_calibration.core.effects.imu_model import ImuModel
from sdimu_calibration.core.evidence.candidate import Candidate
from sdimu_calibration.core.evidence.linear import LinearEvidence

_ROUNDING = 1e-12
"""Ratio of an eigenvalue of the information, in units of the priors, to the largest (1) below which it is zero: an
inverse leaves so much rounding."""


_MOST_ALIKE = 3
"""Number of members of a class beside the one that was found: the likeliest, and each makes every plan slower."""


@dataclass(frozen=True)
class Known:
    """What data so far know of coefficients."""

    names: tuple[str, ...]
    """Coefficients, in the frame of the prior, length k."""
    J: Floats
    """Information of the data alone, without any prior (1/SI^2), shape (k, k)."""
    prior: Floats
    """Shape (k,). Sigma before all data (SI); inf where there is none."""
    scatter: Floats
    """Shape (k,). Sigma (SI) by which the coefficient is another one in the next recording; 0 where it is the same."""

    def of(self, names: Sequence[str], prior: Floats) -> Floats:
        """Information on other coefficients: what they lack is estimated along, what is not known here is zero.

        Parameters
        ----------
        names : sequence of str, length p
        prior : ndarray, shape (p,)
            Sigma of each before all data (SI): the unit of the answer.

        Returns
        -------
        ndarray, shape (p, p)
            Dimensionless.
        """
        along = [k for k, name in enumerate(self.names) if name not in names]
        shared = [k for k, name in enumerate(self.names) if name in names]
        J = self.J[np.ix_(shared, shared)]
        if along:
            unit = np.where(np.isfinite(self.prior[along]), self.prior[along], 1.0)
            stated = np.isfinite(self.prior[along]).astype(np.float64)
            across = self.J[np.ix_(shared, along)] * unit
            own = self.J[np.ix_(along, along)] * np.outer(unit, unit) + np.diag(stated)
            J = J - across @ np.linalg.pinv(own, hermitian=True) @ across.T
        places = [list(names).index(self.names[k]) for k in shared]
        out = np.zeros((len(names), len(names)))
        out[np.ix_(places, places)] = J * np.outer(prior[places], prior[places])
        return out

    def anew(self, names: Sequence[str]) -> Floats:
        """Sigma by which coefficients are others in the next recording.

        Parameters
        ----------
        names : sequence of str, length p

        Returns
        -------
        ndarray, shape (p,)
            SI.
        """
        known = dict(zip(self.names, self.scatter.tolist(), strict=True))
        return np.array([known.get(name, 0.0) for name in names])


def known_of(evidence: LinearEvidence, candidates: Ints, scatter: Sequence[float] = ()) -> Known:
    """Say what an evidence knows of the coefficients of its model and of some candidates.

    Attitudes are estimated along.

    Parameters
    ----------
    evidence : LinearEvidence
        Of one recording, or of a set.
    candidates : ndarray of int, shape (c,)
        Columns of W.
    scatter : sequence of float, length p + c
        As for `Known`; empty: all are the same in the next recording.
    """
    p = evidence.coefficients
    own = np.arange(p, len(evidence.weight))
    J = evidence.information.given(own, evidence.weight[own]).J
    keep = np.concatenate([np.arange(p), np.asarray(candidates, dtype=np.int64)]).astype(np.int64)
    first = len(evidence.weight)
    names = tuple(
        evidence.candidates[k - first].parameter.name if k >= first else evidence.names[k] for k in keep.tolist()
    )
    with np.errstate(divide="ignore"):
        model = 1.0 / np.sqrt(evidence.weight[:p])
    prior = np.concatenate([model, evidence.prior[keep[p:] - first]])
    return Known(names, J[np.ix_(keep, keep)], prior, np.asarray(scatter if len(scatter) else np.zeros(len(keep))))


def in_frame_of_priors(known: Known, asked: ImuModel) -> Known:
    """Bring what is known in the accelerometers' frame into that of the priors, in which plans are judged.

    Parameters
    ----------
    known : Known
        As `known_of` gives it: without the misalignments that the accelerometers' frame makes zero.
    asked : ImuModel
        The model as it was asked for; one that has not all of these was estimated in the frame of its priors.
    """
    pinned = body_frame.pinned_names()
    if not set(pinned) <= set(asked.names) or set(pinned) <= set(known.names):
        return known
    names = (*known.names, *pinned)
    # The data say nothing of the turn of the frame.
    F = body_frame.frame_jacobian(names, body_frame.FRAMES[0], by_temperature=False)[: len(known.names)]
    sizes = dict(zip(known.names, known.prior.tolist(), strict=True))
    for name, size in zip(asked.names, asked.prior.tolist(), strict=True):
        # In the turned frame those of the misalignments hold the turn, too; others may have been widened.
        turns = "misalignment" in name or name not in sizes
        sizes[name] = size if turns else max(size, sizes[name])
    scatter = np.concatenate([known.scatter, np.zeros(len(pinned))])
    return Known(names, F.T @ known.J @ F, np.array([sizes[name] for name in names]), scatter)


def known_from(names: Sequence[str], covariance: Floats, prior: Floats, frame: Floats) -> Known:
    """Take the data's information out of an estimate in a reported body frame.

    The data say nothing of the turns of the body frame that the report pins, so the covariance of the free coefficients
    is ``(prior^-1 + J)^-1`` with the prior in that frame.

    Parameters
    ----------
    names : sequence of str, length p
    covariance : ndarray, shape (p, p)
        As reported (SI).
    prior : ndarray, shape (p,)
        Sigma before all data in the frame of the prior (SI).
    frame : ndarray, shape (p, p)
        Jacobian from the frame of the prior to the reported one (`body_frame.frame_jacobian`).
    """
    free = np.flatnonzero(np.diag(covariance) > 0.0)
    unit = np.sqrt(np.diag(covariance)[free])
    F = frame[free] * prior / unit[:, None]
    J = np.linalg.inv(covariance[np.ix_(free, free)] / np.outer(unit, unit)) - np.linalg.inv(F @ F.T)
    values, V = np.linalg.eigh(0.5 * (J + J.T))
    J = F.T @ (V * np.maximum(values, 0.0)) @ V.T @ F
    return Known(tuple(names), J / np.outer(prior, prior), prior, np.zeros(len(prior)))


def data_information(covariance: Floats, prior: Floats) -> Floats:
    """Information that data alone hold, of the covariance that they leave of a prior.

    Parameters
    ----------
    covariance : ndarray, shape (p, p)
        SI.
    prior : ndarray, shape (p,)
        Sigma of each before (SI).

    Returns
    -------
    ndarray, shape (p, p)
        In units of the priors.
    """
    # Inverted in units of its own sigmas: those of the priors are orders of magnitude apart from it.
    unit = np.sqrt(np.diag(covariance))
    size = prior / unit
    J = np.linalg.inv(covariance / np.outer(unit, unit)) * np.outer(size, size) - np.eye(len(prior))
    values, V = np.linalg.eigh(0.5 * (J + J.T))
    return np.asarray((V * np.where(values > _ROUNDING * values[-1], values, 0.0)) @ V.T)


@dataclass(frozen=True)
class Standing:
    """Where a diagnosis has left a unit: what the next recording begins with."""

    known: Known
    """Of the coefficients of the model, of what was found, and of what looks the same."""
    added: tuple[str, ...] = ()
    """Labels of what was found or looks the same: what a model needs beyond the one given."""
    open: tuple[tuple[str, ...], ...] = ()
    """Classes that the data leave open: labels, that of the one found first."""
    imu: str = ""
    site: str = ""
    """`imu`, `site`: their files as an option names them: names in config/ or paths."""


def class_of(found: Candidate, alike: Sequence[Candidate]) -> tuple[Candidate, ...]:
    """Members of an open class that another recording of any plan can tell apart; empty where it tells none apart.

    Parameters
    ----------
    alike : sequence of Candidate
        What looks the same, the likeliest first.
    """
    if not is_lasting(found.effect):
        return ()
    names, members = {found.parameter.name}, [found]
    for other in alike:
        if is_lasting(other.effect) and other.parameter.name not in names and len(members) <= _MOST_ALIKE:
            names.add(other.parameter.name)
            members.append(other)
    return tuple(members) if len(members) > 1 else ()


def is_lasting(effect: Effect) -> bool:
    """Whether an effect is there in the next recording, too, and a plan on a table can show it by its turns."""
    changes = bool(effect.random_walk) or effect.decay_s is not None
    once = effect.scope not in {"unit", "power-on"} or bool(OF_ONE_TIME & effect.options.keys())
    return not (changes or once or effect.needs == "temperature" or effect.file or effect.never_seen)
