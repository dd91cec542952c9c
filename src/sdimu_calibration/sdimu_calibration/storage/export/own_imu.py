"""An IMU file of our own (``--imu``, parameter `imu` of the nodes) that states the noise which a calibration learned.

The filter on the way takes its noise from such a file, as it cannot learn it (`core/filter/noise_states`).
"""

from __future__ import annotations

from typing import Any

from sdimu_calibration.core.compensation import LinearModel
from sdimu_calibration.core.noise_term import TRIADS
from sdimu_calibration.core.plain_text import one_line
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.stated_noise import not_stated, with_learned
from sdimu_calibration.storage.export.shared import Source
from sdimu_calibration.storage.files.config import load_imu
from sdimu_calibration.storage.files.imu_text import imu_text

_FIELDS = ("quantisation", "bias_instability", "random_walk")
"""What a specification has of each triad beside white noise, in the order of a file."""


def texts(source: Source) -> dict[str, str]:
    """Return the text of the file: grade and priors of the IMU file of the calibration, noise of the calibration.

    White noise of a triad with learned noise is that of the IMU file: a diagnosis scales the white noise to the data,
    noise with a memory in it.
    """
    calibration = source.calibration
    if calibration.of_set is not None:
        raise DataError("each recording of a set has noise of its own, and an IMU file states one: export that of one")
    base = source.imu.file or calibration.origin.imu_stated
    if not base:
        raise DataError("the result names no IMU file: state the one that has grade and priors (--imu)")
    imu, held = with_learned(source.imu, calibration.noise), [t for t in calibration.noise if not not_stated([t])]
    noise: dict[str, Any] = {}
    for triad in TRIADS:
        white = load_imu(base) if any(term.triad == triad for term in calibration.noise) else imu
        noise[triad] = getattr(white, f"{triad}_white_noise")
        noise |= {f"{triad}_{field}": getattr(imu, f"{triad}_{field}") for field in _FIELDS}
    none = "none that a file states" if calibration.noise else "none"
    remarks = [
        f"Noise with a memory that the calibration learned: {', '.join(term.words for term in held) or none}. Grade, "
        f"priors, and white noise beside learned noise are those of {base}.",
        *(f"NOT IN THIS FILE: {text}" for text in source.missing),
    ]
    return {"": imu_text(base, "calibrated", [one_line(remark, None) for remark in remarks], noise)}


def cannot_hold(linear: LinearModel) -> list[str]:
    """Say what is left out beside noise: coefficients are no priors."""
    del linear
    return ["every coefficient (what a result says of a unit is no prior of its type: sdimu fleet makes those)"]
