"""What a page can show besides a diagnosis: table angles, navigation without aid, the ladder of refits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from sdimu_calibration.core.diagnosis.diagnose import Diagnosis
from sdimu_calibration.core.diagnosis.grow import Rung
from sdimu_calibration.core.diagnosis.in_use import in_use
from sdimu_calibration.core.filter.free_inertial import FreeInertialRun
from sdimu_calibration.core.recording import DataError, Recording, TableLog
from sdimu_calibration.core.specification import ImuSpecification, Model, Site


@dataclass(frozen=True)
class ReportExtras:
    """Whatever is known; what is empty is left out of the page.

    Attributes
    ----------
    table : TableLog or None
        Axis angles: shown, never used.
    trials : tuple of FreeInertialRun
        Free navigations of stretches that no fit has seen.
    no_trial : str
        Why there is none.
    rungs : tuple of Rung
        Of real refits, one effect at a time.
    """

    table: TableLog | None = None
    trials: tuple[FreeInertialRun, ...] = ()
    no_trial: str = ""
    rungs: tuple[Rung, ...] = ()


def report_extras(
    recording: Recording,
    diagnosis: Diagnosis,
    site: Site,
    imu: ImuSpecification,
    model: Model,
    rungs: Sequence[Rung] = (),
) -> ReportExtras:
    """Work out what the page of a diagnosis shows besides; site, IMU and model are those of the diagnosis."""
    try:
        trials, reason = in_use(diagnosis, site, imu, model), ""
    except DataError as error:
        trials, reason = (), str(error)
    return ReportExtras(recording.table, trials, reason, tuple(rungs))
