"""What a result of a calibration knows of a unit: less than a diagnosis, as the classes are not in it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from sdimu_calibration.core.effects import body_frame, imu_model
from sdimu_calibration.core.evidence.known import Standing, known_from
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.storage.files.config import load_imu
from sdimu_calibration.storage.files.result_file import read_result


def standing_of_result(path: Path, imu: str | None) -> Standing:
    """Take what a result knows of the coefficients of its model; its classes are not in it.

    Parameters
    ----------
    path : Path
        Folder with result.json, or the file.
    imu : str or None
        Name or path in place of the name in the result.

    Raises
    ------
    DataError
        When the result or its IMU file cannot be read, or they do not fit together.
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
        p.name: prior for e in sensors.effects if e.scope == "power-on" for p in e.parameters
        for prior in [float(sensors.prior[sensors.names.index(p.name)])]
    }  # fmt: skip
    for t in result.of_set.turn_on if result.of_set else ():
        scatter |= {n: min(t.sigma, size) for n, size in scatter.items() if n.startswith(f"{t.effect}_")}
    anew = np.array([scatter.get(n, 0.0) for n in known.names])
    return Standing(replace(known, scatter=anew), imu=result.origin.imu_stated, site=result.origin.site_stated)
