"""What a page shows in addition to a diagnosis: table angles and navigation without aid."""

from __future__ import annotations

from dataclasses import dataclass

from sdimu_calibration.core.diagnosis.diagnose import Diagnosis
from sdimu_calibration.core.estimation.free_inertial import FreeInertialRun
from sdimu_calibration.core.recording import DataError, TableLog


@dataclass(frozen=True)
class ReportExtras:
    """Whatever is known; what is empty is left out of the page.

    Attributes
    ----------
    table : TableLog or None
        Axis angles: shown, never used.
    trials : tuple of FreeInertialRun
        Free navigations of segments that no fit has seen.
    no_trial : str
        Why there is none.
    """

    table: TableLog | None = None
    trials: tuple[FreeInertialRun, ...] = ()
    no_trial: str = ""


def report_extras(diagnosis: Diagnosis) -> ReportExtras:
    """Work out what the page of a diagnosis shows in addition."""
    rivals = [("with what was found", diagnosis.extended)] if len(diagnosis.found.chosen) else []
    table = diagnosis.fit.test.recording.table
    try:
        return ReportExtras(table, diagnosis.fit.free_inertial(rivals))
    except DataError as error:
        return ReportExtras(table, (), str(error))
