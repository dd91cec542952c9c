"""Fits of the workbench, in two parts: the numbers, which are quick, and the candidates, which come after them.

Samples are reduced once a recording, and each fit starts where the fit with one effect less ended. Kept is only what a
page shows: the matrices of a fit, some 200 MB, stay for the last one alone, whose candidates are asked for next.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from threading import Lock
from typing import Any

import numpy as np

from sdimu_calibration.core.alignment.prepared import PreparedData, TestSetup, first_attitude, reduce, set_up
from sdimu_calibration.core.arrays import Floats, Ints
from sdimu_calibration.core.calibrate import assemble, predict_stops
from sdimu_calibration.core.diagnosis.candidates import catalogue, free_inputs
from sdimu_calibration.core.diagnosis.consistency import check
from sdimu_calibration.core.diagnosis.diagnose import Diagnosis
from sdimu_calibration.core.diagnosis.free_input_test import FreeInputTest, free_input_test
from sdimu_calibration.core.diagnosis.scan import scan, threshold
from sdimu_calibration.core.diagnosis.search import FALSE_ALARM, Problem, Search
from sdimu_calibration.core.evidence.navigation_evidence import Evidence, collect, timetable
from sdimu_calibration.core.filter.passes import Solution, one_pass, refine, smoothed_start, solve
from sdimu_calibration.core.measurement_kind import SKIP
from sdimu_calibration.core.progress import silent
from sdimu_calibration.core.recording import DataError, Recording
from sdimu_calibration.core.results import Calibration
from sdimu_calibration.core.specification import ImuSpecification, Model, Site
from sdimu_calibration.report import data
from sdimu_calibration.report.workbench.own_effect import extended

Key = tuple[tuple[str, ...], tuple[int, ...]]
Tell = Callable[[str, float], None]
_MOST_KEPT = 200
"""Fits that are kept: each holds some 2 MB."""
_UNLIKELY = 1e-3


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
    names : tuple of str
        Of the coefficients.
    estimate : ndarray, shape (p,)
        Coefficients in the frame of the prior (SI): where a fit with one effect more begins.
    C_start : ndarray, shape (3, 3)
        Initial attitude as the whole test sees it.
    """

    calibration: Calibration
    grid: data.Grid
    residuals: data.Residuals
    held_out: float
    at_held: float | None
    names: tuple[str, ...]
    estimate: Floats
    C_start: Floats


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
    """A recording on the bench, with the fits made so far; safe for several pages at once."""

    def __init__(self, recording: Recording, site: Site, imu: ImuSpecification, model: Model) -> None:
        self.recording, self.model = recording, model
        self.setup = set_up(site, imu, model)
        self.prepared = reduce(recording, self.setup)
        self._fits: dict[Key, Fitted] = {}
        self._missing: dict[Key, Missing] = {}
        self._warm: tuple[Key, Solution] | None = None
        self._lock = Lock()

    @property
    def stops(self) -> list[int]:
        """Stops with measurements."""
        return [int(s) for s in np.unique(self.prepared.phases.stop[self.prepared.kind > 0])]

    def known(self, added: tuple[str, ...], held: tuple[int, ...]) -> Fitted | None:
        """Return a fit that was made already."""
        return self._fits.get((added, held))

    def fit(self, added: tuple[str, ...], held: tuple[int, ...], tell: Tell | None = None) -> Fitted:
        """Fit the model with the effects `added`, without the stops `held`; `tell` gets a word and the share done.

        Raises
        ------
        DataError
            When an effect cannot be read, or nothing is left to fit.
        """
        with self._lock:
            key = (added, held)
            if key not in self._fits:
                solution = self._solution(key, tell or silent)
                _keep(self._fits, key, self._numbers(key, solution))
            return self._fits[key]

    def missing(self, added: tuple[str, ...], held: tuple[int, ...], tell: Tell | None = None) -> Missing:
        """Score all candidates against a fit, without adding any."""
        with self._lock:
            key = (added, held)
            if key not in self._missing:
                solution = self._solution(key, tell or silent)
                (tell or silent)("candidates", 0.5)
                diagnosis = look(self.recording, solution)
                found = Missing(
                    tuple(data.scored(diagnosis)), diagnosis.found.threshold, diagnosis.adequate, diagnosis.sentence,
                    diagnosis.free_inputs_after,
                )  # fmt: skip
                _keep(self._missing, key, found)
            return self._missing[key]

    def final(self, added: tuple[str, ...], held: tuple[int, ...], tell: Tell | None = None) -> Diagnosis:
        """Fit once more from nothing, as `sdimu calibrate` does, so that it gives the same numbers."""
        with self._lock:
            solution = solve(extended(self.setup, added), masked(self.prepared, held), tell or silent, keep=True)
            final = assemble(self.recording, solution, held_out=True)
            if held:
                told = f"stops held out of the fit: {', '.join(map(str, held))}"
                final = replace(final, notes=(*final.notes, told))
            (tell or silent)("candidates", 0.6)
            return replace(look(self.recording, solution), before=final, after=final)

    def _solution(self, key: Key, tell: Tell) -> Solution:
        if self._warm is not None and self._warm[0] == key:
            return self._warm[1]
        self._warm = None
        added, held = key
        setup, prepared = extended(self.setup, added), masked(self.prepared, held)
        parent = self._fits.get(key) or self._fits.get((added[:-1], held))
        solution = _onward(parent, setup, prepared, tell) if parent else solve(setup, prepared, tell, keep=True)
        self._warm = (key, solution)
        return solution

    def _numbers(self, key: Key, solution: Solution) -> Fitted:
        diagnosis = look(self.recording, solution, candidates=False)
        everything = Problem(diagnosis.evidence.only(np.empty(0, dtype=np.int64)))
        return Fitted(
            diagnosis.after, data.where(diagnosis.consistency), data.residuals(diagnosis),
            everything.held_out([], 1.0).rms, _at_held(self.prepared, solution, key[1]),
            solution.setup.sensors.names, solution.last.estimate, smoothed_start(solution.last),
        )  # fmt: skip


def masked(prepared: PreparedData, held: Sequence[int]) -> PreparedData:
    """Leave the measurements of some stops out.

    Raises
    ------
    DataError
        When fewer than two stops are left, or the first is held out: it gives the attitude.
    """
    if not held:
        return prepared
    out = np.isin(prepared.phases.stop, held)
    left = np.unique(prepared.phases.stop[(prepared.kind > 0) & ~out])
    first = int(prepared.phases.stop[np.argmax(prepared.kind > 0)])
    if first in held or len(left) < 2:
        raise DataError("held-out stops: keep the first stop, which gives the attitude, and at least one more")
    return replace(prepared, kind=np.where(out, SKIP, prepared.kind).astype(np.int64))


def _onward(parent: Fitted, setup: TestSetup, prepared: PreparedData, tell: Tell) -> Solution:
    """Go on from a fit with fewer effects: its coefficients and attitude are where the passes start."""
    start = first_attitude(prepared.epochs, prepared.phases, setup)
    known = dict(zip(parent.names, parent.estimate, strict=True))
    constant = setup.sensors.decay_rate == 0.0
    reference = np.array([known.get(name, 0.0) for name in setup.sensors.names]) * constant

    tell("passes", 0.2)
    try:
        begun = one_pass(prepared, setup, start, parent.C_start, reference, closed_loop=False, keep=False)
        last, passes, converged = refine(prepared, setup, start, begun, tell, keep=True)
    except DataError:
        converged = False
    if not converged:
        return solve(setup, prepared, tell, keep=True)
    return Solution(setup, prepared, start, begun, last, passes, converged)


def look(recording: Recording, solution: Solution, candidates: bool = True) -> Diagnosis:
    """Score all candidates, or none, against a fit, without adding any."""
    setup, prepared = solution.setup, solution.prepared
    times = timetable(prepared)
    known = catalogue(times, set(setup.sensors.names), prepared.temperature is not None) if candidates else []
    free = free_inputs(times) if candidates else []
    evidence = collect(prepared, setup, solution.last, [*known, *free])
    p = len(setup.sensors.prior)
    border = p + sum(len(effect.parameters) for effect in known)
    free_columns = np.arange(border, len(evidence.names))
    found = _nothing_added(evidence, np.arange(p, border))
    left = free_input_test(evidence.information, evidence.model, evidence.weight, free_columns, found.scale)
    fit = assemble(recording, _without_history(solution), held_out=False)
    standing = int(np.sum(np.abs(found.first.z) > found.threshold))
    adequate = candidates and standing == 0 and left.p_value > _UNLIKELY
    best = evidence.names[int(np.argmax(np.abs(found.first.z)))]
    sentence = (
        "Nothing stands out of the noise." if adequate
        else f"{standing} candidates stand out of the noise, {best} most." if standing
        else "Something is left that no candidate stands for."
    )  # fmt: skip
    return Diagnosis(
        "consistent" if adequate else "misfit", sentence, adequate, left.p_value, (), (),
        check(solution.last, prepared), fit, fit, found, evidence, left, left, free_columns, False, False,
    )  # fmt: skip


def _without_history(solution: Solution) -> Solution:
    # The history of the first pass costs as much as the fit, and only a report shows it.
    short = replace(solution.first, output=solution.first.output._replace(stride=len(solution.prepared.epochs)))
    return replace(solution, first=short)


def _nothing_added(evidence: Evidence, columns: Ints) -> Search[Evidence]:
    problem = Problem(evidence.only(columns))
    scale = problem.scale([])
    first = scan(problem.evidence.information, problem.evidence.model, problem.evidence.weight, scale)
    none = np.empty(0, dtype=np.int64)
    return Search((), none, first, first, threshold(first, FALSE_ALARM), scale, evidence)


def _at_held(prepared: PreparedData, solution: Solution, held: Sequence[int]) -> float | None:
    """RMS of normalised prediction errors at the stops that the fit has not seen."""
    if not held:
        return None
    out = np.isin(prepared.phases.stop, held) & (prepared.kind > 0)
    white = predict_stops(prepared, solution.setup, solution.last, out).output.normalised[out]
    return float(np.sqrt(np.nanmean(white**2)))


def _keep(kept: dict[Key, Any], key: Key, value: Any) -> None:
    """Keep a fit; the oldest goes when there are too many."""
    while len(kept) >= _MOST_KEPT:
        kept.pop(next(iter(kept)))
    kept[key] = value
