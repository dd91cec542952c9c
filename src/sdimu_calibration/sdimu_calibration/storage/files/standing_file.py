"""What is known of a unit: entry ``known`` of diagnosis.json (SI), and what a result alone knows."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.effects import body_frame, imu_model
from sdimu_calibration.core.evidence.known import Known, Standing, known_from
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.storage.files.config import load_imu
from sdimu_calibration.storage.files.json_file import entry, read_json
from sdimu_calibration.storage.files.result_file import read_result
from sdimu_calibration.storage.files.result_model import Array, Line, ResultModel, is_semidefinite, wrong

_ROUNDING = 1e-6
"""Share of the information of two coefficients (1) by which rounding may move what they have in common."""
FILE, FORMAT = "diagnosis.json", "sdimu-diagnosis/1"
"""File that holds what is known, and its format."""


class KnownEntry(ResultModel):
    """Entry ``known``: information of the data alone (1/SI^2), priors (``null``: none), changes at a power-on (SI)."""

    names: tuple[Line, ...]
    information: Array
    prior: Array
    scatter: Array
    added: tuple[Line, ...]
    open: tuple[tuple[Line, ...], ...]
    imu: Line
    site: Line

    @classmethod
    def of(cls, standing: Standing) -> KnownEntry:
        """Make the entry of what is known."""
        return cls.model_construct(
            **entry(standing.known, "names information=J prior scatter"), **entry(standing, "added open imu site")
        )

    @property
    def standing(self) -> Standing:
        """What is known; ValueError where its arrays do not fit together."""
        k = len(self.names)
        shapes = self.information.shape, self.prior.shape, self.scatter.shape
        if shapes != ((k, k), (k,), (k,)) or not np.isfinite(self.information).all():
            raise ValueError(f"expected {k} finite rows and columns")
        prior = np.where(np.isnan(self.prior), np.inf, self.prior)
        if not (prior > 0.0).all():
            raise ValueError("a prior is not above zero")
        _check_information(self.information + np.diag(prior**-2.0))
        known = Known(self.names, self.information, prior, self.scatter)
        return Standing(known, self.added, self.open, self.imu, self.site)


def _check_information(information: Floats) -> None:
    """Raise ValueError where data and priors together (k, k) are no information: the inverse is then no covariance."""
    if (np.diag(information) < 0.0).any():
        raise ValueError("information below zero")
    if not is_semidefinite(information, _ROUNDING):
        raise ValueError("the information is that of no data: not symmetric, or below zero along some direction")


def holds_standing(path: Path) -> bool:
    """Whether a path is a folder of results of a diagnosis, or its diagnosis.json."""
    path = Path(path)
    return path.name == FILE if path.is_file() else (path / FILE).is_file()


def read_standing(path: Path) -> Standing:
    """Read what a diagnosis knows. `path`: folder of its results, or diagnosis.json in it."""
    path = Path(path)
    file = path if path.is_file() else path / FILE
    content = read_json(file, FORMAT)
    if not content.get("known"):
        raise DataError(f"{file}: does not say what is known of the unit; run sdimu diagnose again")
    try:
        return KnownEntry.model_validate(content["known"]).standing
    except ValueError as error:
        raise DataError(f"{file}: known: damaged ({wrong(error)}); run sdimu diagnose again") from error


def standing_of_result(path: Path, imu: str | None) -> Standing:
    """Take what a result knows of the coefficients of its model; its classes are not in it.

    `path`: folder with result.json, or the file; `imu`: name or path in place of the name in the result.
    """
    path = Path(path)
    result = read_result(path)
    name = imu or result.origin.imu_stated
    if not name:
        raise DataError(f"{path}: does not say its IMU file: state --imu")
    sensors = imu_model.build(result.model, load_imu(name))
    if sensors.names != result.names:
        raise DataError(f"{path}: its coefficients are not those of its model; run sdimu calibrate again")
    known = known_from(
        sensors.names, result.covariance, sensors.prior, body_frame.frame_jacobian(sensors.names, result.body_frame)
    )
    scatter = {
        p.name: prior
        for e in sensors.effects
        if e.scope == "power-on"
        for p in e.parameters
        for prior in [float(sensors.prior[sensors.names.index(p.name)])]
    }
    for t in result.of_set.turn_on if result.of_set else ():
        scatter |= {n: min(t.sigma, size) for n, size in scatter.items() if n.startswith(f"{t.effect}_")}
    anew = np.array([scatter.get(n, 0.0) for n in known.names])
    return Standing(replace(known, scatter=anew), imu=result.origin.imu_stated, site=result.origin.site_stated)
