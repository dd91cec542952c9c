"""Fits of the workbench, in two parts: the numbers, which are quick, and the candidates, which come after them.

Samples are prepared once a recording, and each fit starts where the fit with one effect less ended. Kept is only what a
page shows: the matrices of a fit, some 200 MB, stay for the last one alone, whose candidates are asked for next.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from threading import Lock
from typing import Any

import numpy as np

from sdimu_calibration.core.diagnosis.diagnose import Diagnosis
from sdimu_calibration.core.diagnosis.free_input_test import FreeInputTest
from sdimu_calibration.core.diagnosis.problem import Problem
from sdimu_calibration.core.diagnosis.survey import survey
from sdimu_calibration.core.estimation.fit import Fit, Start
from sdimu_calibration.core.estimation.navigation_fit import NavigationFit
from sdimu_calibration.core.estimation.outcome import outcome
from sdimu_calibration.core.estimation.prepared_test import PreparedTest
from sdimu_calibration.core.estimation.solve import solve, with_effects
from sdimu_calibration.core.progress import silent
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.results import Calibration, no_history
from sdimu_calibration.core.specification import Model
from sdimu_calibration.report import data
from sdimu_calibration.report.workbench.own_effect import added_effects

Key = tuple[tuple[str, ...], tuple[int, ...]]
Tell = Callable[[str, float], None]
_MOST_KEPT = 200
"""Fits that are kept: each holds some 2 MB."""


@dataclass(frozen=True)
class Fitted:
    """The numbers of one fit.

    Attributes
    ----------
    calibration : Calibration
        Without the history of its first pass.
    grid : Grid
        Normalised means, channel by stop.
    residuals : Residuals
    held_out : float
        Leave-one-stop-out RMS over the stops of the fit (sigma).
    at_held : float or None
        RMS of the prediction errors at the stops that are held out.
    start : Start
        Where a fit with one effect more begins.
    """

    calibration: Calibration
    grid: data.Grid
    residuals: data.Residuals
    held_out: float
    at_held: float | None
    start: Start


@dataclass(frozen=True)
class Missing:
    """What a fit does not explain.

    Attributes
    ----------
    entries : tuple of Scored
        All candidates, largest score first.
    threshold : float
        Size of the score that pure noise reaches.
    adequate : bool
    sentence : str
    left : FreeInputTest
        Of the free inputs.
    """

    entries: tuple[data.Scored, ...]
    threshold: float
    adequate: bool
    sentence: str
    left: FreeInputTest


class FitSession:
    """A recording with the fits made so far; safe for several pages at once."""

    def __init__(self, test: PreparedTest, model: Model) -> None:
        self.test, self.model = test, model
        self._fits: dict[Key, Fitted] = {}
        self._missing: dict[Key, Missing] = {}
        self._warm: tuple[Key, Fit] | None = None
        self._lock = Lock()

    @property
    def stops(self) -> list[int]:
        """Stops with measurements."""
        return [int(s) for s in self.fit((), ()).grid.stops]

    def known(self, added: tuple[str, ...], held: tuple[int, ...]) -> Fitted | None:
        """Return a fit that was made already."""
        return self._fits.get((added, held))

    def fit(self, added: tuple[str, ...], held: tuple[int, ...], tell: Tell = silent) -> Fitted:
        """Fit the model with the effects `added`, without the stops `held`; `tell` gets a word and the share done.

        Raises
        ------
        DataError
            When an effect cannot be read, a stop is none of the recording, or nothing is left to fit.
        """
        self._check(held)
        with self._lock:
            key = (added, held)
            if key not in self._fits:
                _keep(self._fits, key, self._numbers(self._solved(key, tell), held))
            return self._fits[key]

    def missing(self, added: tuple[str, ...], held: tuple[int, ...], tell: Tell = silent) -> Missing:
        """Score all candidates against a fit, without adding any."""
        self._check(held)
        with self._lock:
            key = (added, held)
            if key not in self._missing:
                fit = self._solved(key, tell)
                tell("candidates", 0.5)
                scores = survey(fit, _without_history(fit))
                found = Missing(
                    tuple(data.scored(scores)), scores.found.threshold, scores.adequate, scores.sentence,
                    scores.free_inputs_after,
                )  # fmt: skip
                _keep(self._missing, key, found)
            return self._missing[key]

    def final(self, added: tuple[str, ...], held: tuple[int, ...], tell: Tell = silent) -> Diagnosis:
        """Fit once more from nothing, as `sdimu calibrate` does, so that it gives the same numbers."""
        self._check(held)
        with self._lock:
            fit = solve(self.test.without_stops(held), self._extended(added), progress=tell)
            tell("candidates", 0.6)
            return survey(fit, outcome(fit))

    def _check(self, held: tuple[int, ...]) -> None:
        unknown = sorted(set(held) - set(self.stops)) if held else []
        if unknown:
            raise DataError(f"stop {unknown[0]} has no measurements in this recording")

    def _extended(self, added: tuple[str, ...]) -> Model:
        return with_effects(self.model, added_effects(self.model, added, self.test.imu))

    def _solved(self, key: Key, tell: Tell) -> Fit:
        if self._warm is not None and self._warm[0] == key:
            return self._warm[1]
        self._warm = None
        added, held = key
        test, model = self.test.without_stops(held), self._extended(added)
        parent = self._fits.get(key) or self._fits.get((added[:-1], held))
        try:
            fit = solve(test, model, start=parent.start if parent else None, progress=tell)
        except DataError:
            if parent is None:
                raise
            fit = solve(test, model, progress=tell)
        if not fit.converged and parent is not None:
            fit = solve(test, model, progress=tell)
        self._warm = (key, fit)
        return fit

    def _numbers(self, fit: Fit, held: tuple[int, ...]) -> Fitted:
        scores = survey(fit, _without_history(fit), with_candidates=False)
        everything = Problem(scores.evidence.only(np.empty(0, dtype=np.int64)))
        return Fitted(
            scores.after, data.where(scores.consistency), data.residuals(scores), everything.held_out([], 1.0).rms,
            _at_held(fit, self.test, held), fit.start,
        )  # fmt: skip


def _without_history(fit: Fit) -> Calibration:
    # The history of the first pass costs as much as the fit, and only a report shows it.
    return replace(outcome(fit, held_out=False), history=no_history(len(fit.names)))


def _at_held(fit: Fit, whole: PreparedTest, held: tuple[int, ...]) -> float | None:
    """RMS of normalised prediction errors at the stops that the fit has not seen."""
    if not held or not isinstance(fit, NavigationFit):
        return None
    seen = replace(fit, prepared=whole.data(fit.setup))
    out = np.isin(seen.prepared.phases.stop, held) & (seen.prepared.kind > 0)
    return float(np.sqrt(np.nanmean(seen.predict(out)[out] ** 2)))


def _keep(kept: dict[Key, Any], key: Key, value: Any) -> None:
    """Keep a fit; the oldest goes when there are too many."""
    while len(kept) >= _MOST_KEPT:
        kept.pop(next(iter(kept)))
    kept[key] = value
