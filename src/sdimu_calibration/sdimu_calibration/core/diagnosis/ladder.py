"""The ladder of models: the fit as given, then with one found effect more each, and how far the error fell."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from sdimu_calibration.core.diagnosis.ground import Request
from sdimu_calibration.core.diagnosis.problem import Problem
from sdimu_calibration.core.diagnosis.rounds import Round, in_found_noise
from sdimu_calibration.core.error_figures import held_out, log_likelihood, nis
from sdimu_calibration.core.estimation.fit import Fit
from sdimu_calibration.core.estimation.free_inertial import AS_GIVEN, FOUND
from sdimu_calibration.core.estimation.handheld_fit import HandheldFit
from sdimu_calibration.core.estimation.navigation_fit import NavigationFit
from sdimu_calibration.core.estimation.outcome import outcome
from sdimu_calibration.core.estimation.solve import extend
from sdimu_calibration.core.noise_term import NoiseTerm
from sdimu_calibration.core.progress import Progress
from sdimu_calibration.core.results import Calibration

if TYPE_CHECKING:
    from sdimu_calibration.core.diagnosis.diagnose import Diagnosis

MOVED = 2.0
"""Change of a coefficient (sigma) from which it is listed: chance makes smaller ones."""


@dataclass(frozen=True)
class Rung:
    """One model on the ladder."""

    added: str
    """What this model has beyond the one before; empty for the first."""
    accepted: bool
    reason: str
    """Why it is refused; empty when accepted."""
    log_likelihood: float
    log_bayes_factor: float
    nis_mean: float
    held_out_rms: float
    """`log_likelihood`, `log_bayes_factor`, `nis_mean`, `held_out_rms`: likelihood in the noise that was found, Bayes
    factor against the rung before, NIS and held-out error in white noise."""
    jump: float
    jump_velocity: float
    """`jump`, `jump_velocity`: after turns: RMS of the velocity innovation at the first epoch of each stop, over its
    sigma and in m/s; NaN where nothing is navigated."""
    moved: tuple[tuple[str, float], ...]
    """Coefficients that moved: value less that of the rung before, in sigmas of the latter, largest first."""
    scatter: tuple[float, ...] | None = None
    """What a handheld fit learned beyond white noise: force (m/s^2), rate (rad/s), turn (share of the angle)."""
    fit: Fit | None = field(default=None, repr=False, compare=False)
    """The model fitted to the whole recording."""

    @property
    def name(self) -> str:
        """Of the model, as a ladder tells it."""
        return rung_name(self.added)


def ladder(request: Request, fit: Fit, final: Fit, done: Round, progress: Progress) -> tuple[Rung, ...]:
    """Fit the model with the first, the first two, ... of what a round chose, all in the noise that it found.

    Parameters
    ----------
    request : Request
        Of the search.
    fit, final : Fit
        With the model as given, and with everything that was chosen.
    """
    effects = [c.effect for c in done.chosen]
    fits = [fit]
    for k in range(1, len(effects)):
        progress("refits", 0.9)
        # In noise that it learned by itself its log-likelihood would not compare with the others.
        wider = extend(fit, effects[:k], progress=progress, learn=False)
        fits.append(in_found_noise(request, wider, done.found.noise))
    if effects:
        fits.append(final)
    results = [outcome(one, refuse=one is fits[-1]) for one in fits]
    # Handheld fits learn their sigmas, so their errors compare in the sigmas of one fit only: the last.
    problem, chosen = Problem(done.evidence), [int(c) for c in done.found.chosen]
    rungs: list[Rung] = []
    for k, (one, result) in enumerate(zip(fits, results, strict=True)):
        error = problem.held_out(chosen[:k]).rms if one.learns_scatter else held_out(result)
        added = done.chosen[k - 1].label if k else ""
        rungs.append(_rung(added, one, result, error, results[k - 1] if k else None, rungs[-1] if rungs else None))
    return tuple(rungs)


def figures_in_words(rungs: Sequence[Rung], noise: Sequence[NoiseTerm]) -> str:
    """Say in which noise the figures of a ladder are. `noise`: with a memory, that the diagnosis found."""
    if any(rung.scatter is not None for rung in rungs):
        return "log-likelihood: with the scatter that each model learned; held-out: in sigmas of the last model"
    if not noise:
        return "log-likelihood, nis and held-out: in white noise"
    found = ", ".join(dict.fromkeys(term.words for term in noise))
    return f"log-likelihood: of every model in the noise that was found ({found}); nis and held-out: in white noise"


def error_ladder(d: Diagnosis) -> list[tuple[str, float]]:
    """Held-out error (`error_figures.held_out`) of the model as given and with what was found, by name.

    With every effect by itself where the model was grown, else with all of them at once; with nothing found one entry.
    """
    if d.rungs:
        return [(r.name, r.held_out_rms) for r in d.rungs]
    first = (AS_GIVEN, held_out(d.before))
    added = [c.label for c in d.chosen]
    name = rung_name(added[0]) if len(added) == 1 else FOUND
    return [first, (name, held_out(d.after))] if added else [first]


def rung_name(added: str) -> str:
    """Name a model by what it has beyond the one before; empty for the first."""
    return f"+ {added}" if added else AS_GIVEN


def _rung(
    added: str, fit: Fit, result: Calibration, error: float, earlier: Calibration | None, below: Rung | None
) -> Rung:
    likelihood = log_likelihood(result)
    standard, velocity = jump(fit)
    rung = Rung(
        added,
        True,
        "",
        likelihood,
        likelihood - below.log_likelihood if below else 0.0,
        nis(result),
        error,
        standard,
        velocity,
        moved_coefficients(earlier, result) if earlier else (),
        tuple(fit.scatter.tolist()) if isinstance(fit, HandheldFit) else None,
        fit,
    )
    reason = refused(rung, below)
    return replace(rung, accepted=not reason, reason=reason)


def refused(rung: Rung, below: Rung | None) -> str:
    """Say why a rung is refused against the one below; empty when it is not."""
    if below is None or rung.held_out_rms < below.held_out_rms:
        return ""
    return "does not lower the error at stops that the fit has not seen"


def jump(fit: Fit) -> tuple[float, float]:
    """RMS of the velocity innovation at the first epoch of each stop: over its sigma, and in m/s; NaN if none."""
    if not isinstance(fit, NavigationFit):
        return float("nan"), float("nan")
    output = fit.known.output
    rows = np.flatnonzero(fit.prepared.phases.first & np.isfinite(output.innovation[:, 3]))
    if not len(rows):
        return float("nan"), float("nan")
    nu, sigma = output.innovation[rows, 3:6], output.innovation_sigma[rows, 3:6]
    return float(np.sqrt(np.mean((nu / sigma) ** 2))), float(np.sqrt(np.mean(nu**2)))


def moved_coefficients(earlier: Calibration, later: Calibration, least: float = MOVED) -> tuple[tuple[str, float], ...]:
    """Coefficients of both results that differ by more than `least` of the earlier sigma, largest first.

    Later less earlier: positive where a value grows as the model does.
    """
    index = {name: k for k, name in enumerate(later.names)}
    out = []
    for k, name in enumerate(earlier.names):
        sigma = float(np.sqrt(earlier.covariance[k, k]))
        if name in index and sigma > 0.0:
            size = float(later.values[index[name]] - earlier.values[k]) / sigma
            if abs(size) > least:
                out.append((name, size))
    return tuple(sorted(out, key=lambda item: -abs(item[1])))
