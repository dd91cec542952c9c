"""What a page shows in addition to a diagnosis: table angles and navigation without aid."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from sdimu_calibration.core.diagnosis.diagnose import Diagnosis
from sdimu_calibration.core.estimation.fit import Fit
from sdimu_calibration.core.estimation.free_inertial import FOUND, FreeInertialRun
from sdimu_calibration.core.estimation.outcome import outcome
from sdimu_calibration.core.recording import DataError, TableLog
from sdimu_calibration.core.results import Calibration

if TYPE_CHECKING:  # a result of one recording has none: fifty modules less to load
    from sdimu_calibration.core.joint.set_ladder import SetLadder


@dataclass(frozen=True)
class ReportExtras:
    """Whatever is known; what is empty is left out of the page."""

    table: TableLog | None = None
    """Axis angles: shown, never used."""
    trials: tuple[FreeInertialRun, ...] = ()
    """Free navigations of segments that no fit has seen."""
    no_trial: str = ""
    """Why there is none."""
    given: Calibration | None = None
    """What a calibration delivers with the model as given, noise with a memory learned without what is missing."""


def of_navigations(ladder: SetLadder) -> ReportExtras:
    """Take the navigations of a set as those of one recording."""
    return ReportExtras(trials=ladder.in_use, no_trial=ladder.not_tried)


def report_extras(diagnosis: Diagnosis, delivered: Fit | None = None) -> ReportExtras:
    """Work out what the page of a diagnosis shows in addition.

    `delivered`: the fit that was diagnosed, as a calibration delivers it; without it the fit of the diagnosis stands in
    its place.
    """
    between = [(rung.name, rung.fit) for rung in diagnosis.rungs[1:-1] if rung.fit is not None]
    rivals = [*between, (FOUND, diagnosis.extended)] if len(diagnosis.found.chosen) else []
    table = diagnosis.fit.test.recording.table
    given = None if delivered is None else outcome(delivered, refuse=False)
    try:
        return ReportExtras(table, (delivered or diagnosis.fit).free_inertial(rivals), given=given)
    except DataError as error:
        return ReportExtras(table, (), str(error), given)
