"""Grow the model by real refits, one effect at a time, and keep the ladder: how far the error fell with each.

Each rung is a whole calibration and a diagnosis of it. The log-likelihood of the filter is that of one-step predictions
with the coefficients' priors in them, so its difference between two rungs is the log Bayes factor of the effect.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import cast

import numpy as np

from sdimu_calibration.core.diagnosis.diagnose import Diagnosis, diagnose
from sdimu_calibration.core.effects.effect import Effect
from sdimu_calibration.core.progress import Progress
from sdimu_calibration.core.recording import Recording
from sdimu_calibration.core.results import Calibration
from sdimu_calibration.core.specification import ImuSpecification, Model, Site

MOST_RUNGS = 6
MOVED = 2.0
"""Coefficients that moved by more than this many of their sigmas are told."""


@dataclass(frozen=True)
class Rung:
    """One model on the ladder.

    Attributes
    ----------
    added : str
        What this model has beyond the one before; empty for the first.
    accepted : bool
    reason : str
        Why it was refused; empty when accepted.
    log_likelihood, log_bayes_factor, nis_mean, held_out_rms : float
        Bayes factor against the rung before.
    jump, jump_velocity : float
        After turns: RMS of the velocity innovation at the first epoch of each stop, over its sigma and in m/s.
    moved : tuple of (str, float)
        Coefficients that moved against the rung before, in their sigmas, largest first.
    """

    added: str
    accepted: bool
    reason: str
    log_likelihood: float
    log_bayes_factor: float
    nis_mean: float
    held_out_rms: float
    jump: float
    jump_velocity: float
    moved: tuple[tuple[str, float], ...]


@dataclass(frozen=True)
class Growth:
    """A grown model.

    Attributes
    ----------
    rungs : tuple of Rung
        A refused one ends it.
    model : Model
        Of the last accepted rung.
    diagnoses : tuple of Diagnosis
        One a rung; the first is of the model as given.
    """

    rungs: tuple[Rung, ...]
    model: Model
    diagnoses: tuple[Diagnosis, ...]


def grow(
    recording: Recording,
    site: Site,
    imu: ImuSpecification,
    model: Model,
    extra: Sequence[Effect] = (),
    progress: Progress | None = None,
    first: Diagnosis | None = None,
) -> Growth:
    """Add the best effect, refit, look again, until consistent, unexplained or refused.

    Parameters
    ----------
    recording, site, imu, model, extra, progress
        As for `diagnose`.
    first : Diagnosis, optional
        Of the model as given, when there is one already.

    Raises
    ------
    DataError
        When the recording or the options cannot be used.
    """
    here = first or diagnose(recording, site, imu, model, extra, progress=progress)
    rungs = [rung("", here, None)]
    diagnoses = [here]
    while len(rungs) < MOST_RUNGS and here.verdict not in {"consistent", "unexplained", "noise model wrong"}:
        if not here.chosen:
            break
        added = here.chosen[0]
        wider = with_effects(model, [added.effect])
        there = diagnose(recording, site, imu, wider, extra, progress=progress)
        step = rung(added.label, there, here)
        rungs.append(step)
        diagnoses.append(there)
        if not step.accepted:
            break
        model, here = wider, there
    return Growth(tuple(rungs), model, tuple(diagnoses))


def with_effects(model: Model, effects: Sequence[Effect]) -> Model:
    """Return the model with more effects.

    A model names its effects; one that no registry knows stands for itself, as `imu_model.build` takes it.
    """
    return replace(model, effects=cast("tuple[str, ...]", (*model.effects, *effects)))


def rung(added: str, here: Diagnosis, before: Diagnosis | None) -> Rung:
    """Compare a diagnosed model with the one before it on the ladder."""
    fit = here.before.fit
    held_out = _number(fit.get("held_out_rms"))
    likelihood = _number(fit.get("log_likelihood"))
    reason, bayes = "", 0.0
    moved: tuple[tuple[str, float], ...] = ()
    if before is not None:
        earlier = before.before
        bayes = likelihood - _number(earlier.fit.get("log_likelihood"))
        moved = moved_coefficients(earlier, here.before)
        if not held_out < _number(earlier.fit.get("held_out_rms")):
            reason = "does not lower the error at stops that the fit has not seen"
    standard, velocity = jump(here)
    return Rung(
        added, not reason, reason, likelihood, bayes, _number(fit.get("nis_mean")), held_out, standard, velocity, moved
    )


def jump(d: Diagnosis) -> tuple[float, float]:
    """RMS of the velocity innovation at the first epoch of each stop: over its sigma, and in m/s."""
    evidence = d.evidence
    phases = evidence.prepared.phases
    whitened = np.zeros((len(phases.first), 12))
    whitened[evidence.epoch, evidence.channel] = evidence.e
    measured = np.zeros(whitened.shape, dtype=bool)
    measured[evidence.epoch, evidence.channel] = True
    rows = np.flatnonzero(phases.first & measured[:, 3])
    if not len(rows):
        return float("nan"), float("nan")
    L = evidence.output.L[rows]
    nu = np.einsum("eij,ej->ei", L, whitened[rows])[:, 3:6]
    sigma = np.sqrt(np.einsum("eij,eij->ei", L, L))[:, 3:6]
    return float(np.sqrt(np.mean((nu / sigma) ** 2))), float(np.sqrt(np.mean(nu**2)))


def moved_coefficients(
    earlier: Calibration, later: Calibration, least: float = MOVED
) -> tuple[tuple[str, float], ...]:
    """Coefficients of both results that differ by more than `least` of the earlier sigma, largest first."""
    index = {name: k for k, name in enumerate(later.names)}
    out = []
    for k, name in enumerate(earlier.names):
        sigma = float(np.sqrt(earlier.covariance[k, k]))
        if name in index and sigma > 0.0:
            size = float(later.values[index[name]] - earlier.values[k]) / sigma
            if abs(size) > least:
                out.append((name, size))
    return tuple(sorted(out, key=lambda item: -abs(item[1])))


def _number(value: float | None) -> float:
    return float("nan") if value is None else float(value)
