"""An IMU file of our own (``--imu``, parameter `imu` of the nodes) that states the noise which a calibration learned.

The filter on the way takes its noise from such a file, as it cannot learn it (`core/filter/noise_states`).
"""

from __future__ import annotations

from sdimu_calibration.core.compensation import LinearModel
from sdimu_calibration.core.plain_text import one_line
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.stated_noise import not_stated, with_learned
from sdimu_calibration.storage.export.shared import Source
from sdimu_calibration.storage.files.imu_text import imu_text

_FIELDS = ("quantisation", "bias_instability", "random_walk")
"""What a specification has of each triad beside white noise, in the order of a file."""


def texts(source: Source) -> dict[str, str]:
    """Return the text of the file: grade and priors of the IMU file of the calibration, noise of the calibration."""
    calibration = source.calibration
    base = source.imu.file or calibration.origin.imu_stated
    if not base:
        raise DataError("the result names no IMU file: state the one that has grade and priors (--imu)")
    imu = with_learned(source.imu, calibration.noise)
    noise = {}
    for triad in ("gyro", "accel"):
        noise[triad] = getattr(imu, f"{triad}_white_noise")
        noise |= {f"{triad}_{field}": getattr(imu, f"{triad}_{field}") for field in _FIELDS}
    learned = [term.words for term in calibration.noise if not not_stated([term])]
    remarks = [
        f"Learned by the calibration: {', '.join(learned) or 'no noise with a memory'}. Grade, priors and other noise "
        f"are those of {base}.",
        *(f"NOT IN THIS FILE: {text}" for text in source.missing),
    ]
    return {"": imu_text(base, "calibrated", [one_line(remark, None) for remark in remarks], noise)}


def cannot_hold(linear: LinearModel) -> list[str]:
    """Say what is left out beside noise: coefficients are no priors."""
    del linear
    return ["every coefficient (what a result says of a unit is no prior of its type: sdimu fleet makes those)"]
