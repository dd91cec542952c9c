"""What a diagnosis is worth in use: free navigation with no compensation, with the model, and with what was found."""

from __future__ import annotations

from dataclasses import replace

from sdimu_calibration.core.alignment.prepared import TestSetup, set_up
from sdimu_calibration.core.diagnosis.diagnose import Diagnosis
from sdimu_calibration.core.effects.imu_model import build
from sdimu_calibration.core.filter import free_inertial
from sdimu_calibration.core.filter.free_inertial import FreeInertialRun
from sdimu_calibration.core.specification import ImuSpecification, Model, Site

AS_GIVEN, WITH_FOUND = "model as given", "with what was found"


def in_use(diagnosis: Diagnosis, site: Site, imu: ImuSpecification, model: Model) -> tuple[FreeInertialRun, ...]:
    """Navigate stretches of the diagnosed recording that no fit has seen, without aid.

    Parameters
    ----------
    diagnosis : Diagnosis
    site, imu, model
        Those that `diagnose` was given.

    Raises
    ------
    DataError
        When the recording has no stretch to spare, or what is left of it cannot be calibrated.
    """
    setup = set_up(site, imu, model)
    setups: list[tuple[str, TestSetup]] = [(AS_GIVEN, setup)]
    if diagnosis.chosen:
        sensors = build([*setup.sensors.effects, *(c.effect for c in diagnosis.chosen)], imu)
        setups.append((WITH_FOUND, replace(setup, sensors=sensors)))
    evidence = diagnosis.evidence
    return free_inertial.in_use(evidence.prepared, setups, evidence.output)
