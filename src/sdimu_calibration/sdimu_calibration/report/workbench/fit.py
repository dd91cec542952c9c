"""Fits of the workbench: quick, because samples are reduced once and each fit starts where its parent ended."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from threading import Lock

import numpy as np
from numpy.typing import NDArray

from sdimu_calibration.core import imu_model
from sdimu_calibration.core.calibrate import assemble, predict_stops
from sdimu_calibration.core.diagnosis.candidates import catalogue, free_inputs, without
from sdimu_calibration.core.diagnosis.consistency import check
from sdimu_calibration.core.diagnosis.diagnose import Diagnosis
from sdimu_calibration.core.diagnosis.evidence import Evidence, collect, test_times
from sdimu_calibration.core.diagnosis.remainder import remainder
from sdimu_calibration.core.diagnosis.scan import scan, threshold
from sdimu_calibration.core.diagnosis.search import FALSE_ALARM, Problem, Search
from sdimu_calibration.core.effects.effect import Effect
from sdimu_calibration.core.filter_pass import SKIP
from sdimu_calibration.core.passes import (
    Reduced,
    Setup,
    Solution,
    one_pass,
    reduce,
    refine,
    set_up,
    smoothed_start,
    solve,
)
from sdimu_calibration.core.recording import DataError, Recording
from sdimu_calibration.core.specification import ImuSpecification, Model, Site
from sdimu_calibration.storage.effect_file import find_effects, load_effect

Key = tuple[tuple[str, ...], tuple[int, ...]]
_MOST_KEPT = 12
"""Fits that are kept: each holds some 100 MB of signatures."""


@dataclass(frozen=True)
class Fitted:
    """One fit.

    Attributes
    ----------
    solution : Solution
    diagnosis : Diagnosis
        With nothing added to this model: what the figures of the report draw.
    held_out : float
        Leave-one-stop-out RMS over the stops of the fit (sigma).
    at_held : float or None
        RMS of the prediction errors at the stops that are held out.
    """

    solution: Solution
    diagnosis: Diagnosis
    held_out: float
    at_held: float | None


class Bench:
    """A recording on the bench, with the fits made so far; safe for several pages at once."""

    def __init__(self, recording: Recording, site: Site, imu: ImuSpecification, model: Model) -> None:
        self.recording, self.model = recording, model
        self.setup = set_up(site, imu, model)
        self.reduced = reduce(recording, self.setup)
        self._kept: dict[Key, Fitted] = {}
        self._lock = Lock()

    @property
    def stops(self) -> list[int]:
        """Stops with measurements."""
        return [int(s) for s in np.unique(self.reduced.phases.stop[self.reduced.kind > 0])]

    def fit(self, added: tuple[str, ...], held: tuple[int, ...]) -> Fitted:
        """Fit the model with the effects `added`, without the stops `held`.

        Raises
        ------
        DataError
            When an effect cannot be read, or nothing is left to fit.
        """
        with self._lock:
            key = (added, held)
            if key not in self._kept:
                while len(self._kept) >= _MOST_KEPT:
                    self._kept.pop(next(iter(self._kept)))
                self._kept[key] = self._fit(added, held)
            return self._kept[key]

    def _fit(self, added: tuple[str, ...], held: tuple[int, ...]) -> Fitted:
        setup = extended(self.setup, added)
        reduced = masked(self.reduced, held)
        parent = self._kept.get((added[:-1], held))
        solution = solve(setup, reduced, _silent, keep=True) if parent is None else _onward(parent.solution, setup)
        diagnosis = _look(self.recording, solution)
        everything = Problem(diagnosis.evidence.only(np.empty(0, dtype=np.int64)))
        return Fitted(solution, diagnosis, everything.held_out([], 1.0).rms, _at_held(self.reduced, solution, held))


def extended(setup: Setup, added: Sequence[str]) -> Setup:
    """Add effects to a model: by name, or by the text of an effect file.

    Raises
    ------
    DataError
        When one cannot be read.
    """
    effects: list[Effect] = list(setup.sensors.effects)
    for text in added:
        have = {p.name for e in effects for p in e.parameters}
        new = [part for effect in read_effect(text) for part in without(effect, have)]
        if not new:
            raise DataError(f"'{text.strip().splitlines()[0]}' is in the model already")
        effects += new
    sensors = imu_model.build(effects, setup.imu)
    return replace(setup, sensors=sensors, model=replace(setup.model, effects=tuple(e.name for e in effects)))


def read_effect(text: str) -> tuple[Effect, ...]:
    """Read an effect by name or by the text of an effect file (several lines).

    Raises
    ------
    DataError
        One line without the name of the temporary file.
    """
    if "\n" not in text.strip():
        return find_effects(text.strip())
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "effect.yaml"
        path.write_text(text, encoding="utf-8")
        try:
            return load_effect(path)
        except DataError as error:
            raise DataError(str(error).replace(f"{path}: ", "")) from error


def masked(reduced: Reduced, held: Sequence[int]) -> Reduced:
    """Leave the measurements of some stops out.

    Raises
    ------
    DataError
        When fewer than two stops are left, or the first is held out: it gives the attitude.
    """
    if not held:
        return reduced
    out = np.isin(reduced.phases.stop, held)
    left = np.unique(reduced.phases.stop[(reduced.kind > 0) & ~out])
    first = int(reduced.phases.stop[np.argmax(reduced.kind > 0)])
    if first in held or len(left) < 2:
        raise DataError("held-out stops: keep the first stop, which gives the attitude, and at least one more")
    return replace(reduced, kind=np.where(out, SKIP, reduced.kind).astype(np.int64))


def _onward(parent: Solution, setup: Setup) -> Solution:
    """Go on from a fit with fewer effects: its coefficients and attitude are where the passes start."""
    known = dict(zip(parent.setup.sensors.names, parent.last.estimate, strict=True))
    constant = setup.sensors.decay_rate == 0.0
    reference = np.array([known.get(name, 0.0) for name in setup.sensors.names]) * constant
    start = smoothed_start(parent.last)
    begun = one_pass(parent.reduced, setup, parent.alignment, start, reference, closed_loop=False, keep=False)
    last, passes, converged = refine(parent.reduced, setup, parent.alignment, begun, _silent, keep=True)
    # The history of the closed loop is made anew: it has more coefficients now.
    none = np.zeros(len(setup.sensors.prior))
    first = one_pass(
        parent.reduced, setup, parent.alignment, parent.alignment.C_nb, none, closed_loop=True, keep=False
    )
    return Solution(setup, parent.reduced, parent.alignment, first, last, passes + 1, converged)


def _look(recording: Recording, solution: Solution) -> Diagnosis:
    """Score all candidates against a fit, without adding any."""
    setup, reduced = solution.setup, solution.reduced
    times = test_times(reduced)
    known = catalogue(times, set(setup.sensors.names), reduced.temperature is not None)
    free = free_inputs(times)
    evidence = collect(reduced, setup, solution.last, [*known, *free])
    p = len(setup.sensors.prior)
    border = p + sum(len(effect.parameters) for effect in known)
    free_columns = np.arange(border, len(evidence.names))
    found = _nothing_added(evidence, np.arange(p, border))
    left = remainder(evidence.information, evidence.model, evidence.weight, free_columns, found.scale)
    fit = assemble(recording, solution, held_out=False)
    standing = int(np.sum(np.abs(found.first.z) > found.threshold))
    adequate = standing == 0 and left.p_value > _UNLIKELY
    best = evidence.names[int(np.argmax(np.abs(found.first.z)))]
    sentence = (
        "Nothing stands out of the noise." if adequate
        else f"{standing} candidates stand out of the noise, {best} most." if standing
        else "Something is left that no candidate stands for."
    )  # fmt: skip
    return Diagnosis(
        "consistent" if adequate else "misfit", sentence, adequate, left.p_value, (), (),
        check(solution.last, reduced), fit, fit, found, evidence, left, left, free_columns, False, False,
    )  # fmt: skip


_UNLIKELY = 1e-3


def _nothing_added(evidence: Evidence, columns: NDArray[np.int64]) -> Search:
    problem = Problem(evidence.only(columns))
    scale = problem.scale([])
    first = scan(problem.evidence.information, problem.evidence.model, problem.evidence.weight, scale)
    return Search((), np.empty(0, dtype=np.int64), first, first, threshold(first, FALSE_ALARM), scale)


def _at_held(reduced: Reduced, solution: Solution, held: Sequence[int]) -> float | None:
    """RMS of normalised prediction errors at the stops that the fit has not seen."""
    if not held:
        return None
    out = np.isin(reduced.phases.stop, held) & (reduced.kind > 0)
    white = predict_stops(reduced, solution.setup, solution.last, out).output.normalised[out]
    return float(np.sqrt(np.nanmean(white**2)))


def _silent(_what: str, _fraction: float) -> None:
    return None
