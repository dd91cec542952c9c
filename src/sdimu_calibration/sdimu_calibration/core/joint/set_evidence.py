"""The evidence of a set: rows of all power-ons, whitened with what power-ons are allowed to differ by.

It is a `LinearEvidence` like that of one recording, so the same search works on it; what is left out to test a
prediction is a whole power-on.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.effects.effect import Effect
from sdimu_calibration.core.effects.selection import of_catalogue
from sdimu_calibration.core.evidence.candidate import Candidate
from sdimu_calibration.core.evidence.held_out import HeldOut, predict
from sdimu_calibration.core.evidence.in_stops import InStops
from sdimu_calibration.core.evidence.linear import LinearEvidence, candidate_priors
from sdimu_calibration.core.joint.combine import Rows, spread_out, stacked
from sdimu_calibration.core.joint.joint_prior import prior_weight
from sdimu_calibration.core.joint.reduction import compressed, unit_noise
from sdimu_calibration.core.joint.scope import split_tag
from sdimu_calibration.core.joint.set_fit import SetFit, columns_of
from sdimu_calibration.core.joint.shared_function import is_weight
from sdimu_calibration.core.probability import squares_tail

MOST_FOLDS = 50
"""Number of folds of power-ons at most: each is left out once, and more folds predict no better."""


@dataclass(frozen=True)
class SetEvidence(LinearEvidence):
    """Evidence of a set about its joint estimate; rows of one fold have one stop."""

    def signature(self, effects: Sequence[Effect]) -> Floats:
        """Refuse: signatures come with the reductions of the recordings.

        Raises
        ------
        NotImplementedError
            Always.
        """
        raise NotImplementedError(f"signatures of {len(effects)} effects come with the reductions")


def set_evidence(fit: SetFit, candidates: Sequence[Candidate]) -> SetEvidence:
    """Put the rows of all recordings together.

    Parameters
    ----------
    fit : SetFit
        Its reports have the signatures of the candidates.
    candidates : sequence of Candidate
        The same in all recordings, or of single ones, by labels with the name of the recording.
    """
    tried = [replace(c, effect=replace(c.effect, nearer=None)) for c in candidates]
    names = (*fit.names, *(c.label for c in tried))
    P = len(fit.names)
    folds = [_white(fit, members, names) for members in _folds(fit)]
    A, y = np.vstack([f.A for f in folds]), np.concatenate([f.y for f in folds])
    imu = fit.reports[0].imu
    _, prior = candidate_priors([c.effect for c in tried], imu)
    e, values = y - A[:, :P] @ fit.estimate.values, fit.estimate.values.copy()
    for own, shared in own_values(fit.names):
        # The value of one recording as its difference from that of the others: without it theirs holds there too.
        A[:, shared] += A[:, own]
        values[own] -= values[shared]
    return SetEvidence(
        e=e,
        W=A,
        stop=np.repeat(np.arange(len(folds)), [len(f.y) for f in folds]),
        names=names,
        weight=fit.weight,
        shift=-values,
        stated=1.0 / np.sqrt(prior_weight(fit.reports, fit.names)),
        candidates=tuple(tried),
        prior=prior,
        imu=imu,
        times=fit.reports[0].times,
        coefficients=P - sum(map(is_weight, fit.names)),
        found=of_catalogue(fit.model.found),
    )


def own_values(names: Sequence[str]) -> list[tuple[int, int]]:
    """Places of coefficients that one recording has for itself, each with the place of that of all others.

    Parameters
    ----------
    names : sequence of str
        Coefficients of a set.
    """
    place = {name: k for k, name in enumerate(names)}
    parts = [(k, *split_tag(name)) for name, k in place.items()]
    return [(k, place[name]) for k, name, recording in parts if recording and name in place]


def differences(names: Sequence[str]) -> Floats:
    """Take coefficients to those in which the value of one recording is its difference from that of all others.

    Parameters
    ----------
    names : sequence of str, length P
        Coefficients of a set.

    Returns
    -------
    ndarray, shape (P, P)
    """
    D = np.eye(len(names))
    for own, shared in own_values(names):
        D[own, shared] = -1.0
    return D


def _folds(fit: SetFit) -> Sequence[Sequence[Sequence[int]]]:
    """Folds of power-ons of recordings: by power-on where several were made, else each recording a fold."""
    if len(fit.power_ons) == 1:
        return [[[k]] for k in range(len(fit.reports))]
    count = min(len(fit.groups), MOST_FOLDS)
    return [fit.groups[fold::count] for fold in range(count)]


def _white(fit: SetFit, groups: Sequence[Sequence[int]], names: Sequence[str]) -> Rows:
    """Rows of some power-ons in white noise, compressed to as many as there are parameters."""
    rows = stacked([white_power_on(fit, members, names)[0] for members in groups])
    return rows if len(rows.y) <= len(names) else Rows(*compressed(rows.A, rows.y))


def white_power_on(
    fit: SetFit, members: Sequence[int], names: Sequence[str], own: Sequence[Floats] = ()
) -> tuple[Rows, list[Floats]]:
    """Rows of one power-on in white noise: what it may differ by is part of the noise.

    Parameters
    ----------
    members : sequence of int
        Places of its recordings among the reports.
    names : sequence of str, length P
        Parameters of the rows.
    own : sequence of ndarray, shape (k, m)
        Of each recording, columns that are zero in the rows of all others (per SI unit); none has any without.

    Returns
    -------
    rows : Rows
        Of all recordings of the power-on, one below the other.
    own : list of ndarray, shape (sum of k, m)
        The columns in them.
    """
    rows = stacked([spread_out(fit.reports[k].reduction, names) for k in members])
    ends = np.cumsum([0, *(len(columns) for columns in own)])
    wide = [np.zeros((len(rows.y), columns.shape[1])) for columns in own]
    for k, columns in enumerate(own):
        wide[k][ends[k] : ends[k + 1]] = columns
    if not fit.turn_on:
        return rows, wide
    components = columns_of(fit.varying, fit.names)
    modes = np.hstack([rows.A[:, c.columns] * t for c, t in zip(components, fit.tau, strict=True)])
    together = InStops.of(modes, np.zeros(len(modes), dtype=np.int64))
    white = unit_noise(together, np.column_stack([*wide, rows.A, rows.y]))
    parts = np.split(white, np.cumsum([*(columns.shape[1] for columns in wide), len(names)]), axis=1)
    return Rows(parts[-2], parts[-1][:, 0]), parts[:-2]


def held_out(fit: SetFit, without: Sequence[str] = ()) -> HeldOut | None:
    """Predict every power-on from the others, every recording where there is one; None for a single one.

    Parameters
    ----------
    without : sequence of str
        Coefficients of the fit that the model lacks; the noise stays that of the fit, in which it compares.
    """
    evidence = set_evidence(fit, ())
    if len(np.unique(evidence.stop)) < 2:
        return None
    lacks = np.isin(evidence.names, list(without))
    kept = np.flatnonzero(~lacks)
    bare = replace(evidence, e=evidence.e + evidence.W[:, lacks] @ fit.estimate.values[lacks])
    return predict(bare, kept, evidence.weight[kept], evidence.shift[kept])


def held_out_chance(fit: SetFit, rms: float) -> float:
    """Probability that the held-out error of a model that is right exceeds `rms`.

    All errors of a power-on hang on the same few differences between it and the others, which stand in the errors of
    the others, too: the squares have fewer degrees of freedom than there are rows.

    Parameters
    ----------
    fit : SetFit
        Two power-ons or more.
    rms : float
        RMS of the normalised prediction errors (`held_out`).
    """
    evidence = set_evidence(fit, ())
    # All errors are a linear function of what is random: the noise of the rows, and the coefficients about their prior.
    random = np.vstack([evidence.W, np.diag(np.sqrt(evidence.weight))])
    errors = np.zeros((len(evidence.e), len(random)))
    unit = 1.0 / np.sqrt(np.sum(random**2, axis=0))
    random = random * unit
    for stop in np.unique(evidence.stop):
        rows = np.flatnonzero(evidence.stop == stop)
        others = random.copy()
        others[rows] = 0.0
        errors[rows] = -random[rows] @ np.linalg.solve(others.T @ others, others.T)
        errors[rows, rows] = 1.0
    errors /= np.linalg.norm(errors, axis=1)[:, None]
    return squares_tail(rms**2 * len(errors), np.asarray(np.linalg.eigvalsh(errors @ errors.T), dtype=np.float64))
