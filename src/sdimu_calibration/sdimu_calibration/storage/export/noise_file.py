"""Noise alone, for programs that get samples which are compensated already: Kalibr's ``imu.yaml`` and GTSAM's metadata.

Kalibr (kalibr_common/ConfigReader.py, ImuParameters) reads four densities, a topic and a rate.

GTSAM (examples/IMUKittiExampleGPS.cpp, loadKittiData) passes over one line and reads twelve numbers from the next. With
n samples between two biases, dt apart,

    accelerometerCovariance = AccelerometerSigma^2 I,     sigma of the bias's change = sqrt(n) AccelerometerBiasSigma,

and the same for the gyros: the first is the density of the white noise, the second the random walk times sqrt(dt).
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from sdimu_calibration.core.compensation import LinearModel
from sdimu_calibration.core.noise_term import RANDOM_WALK, NoiseTerm
from sdimu_calibration.core.plain_text import one_line
from sdimu_calibration.storage.export.kalibr import noise_lines
from sdimu_calibration.storage.export.shared import Source, number

_GTSAM = (
    "BodyPtx BodyPty BodyPtz BodyPrx BodyPry BodyPrz AccelerometerSigma GyroscopeSigma IntegrationSigma "
    "AccelerometerBiasSigma GyroscopeBiasSigma AverageDeltaT"
)
"""Line of names in the file of the example, in the order of the numbers below it."""
_EQUATIONS = (
    "Noise of the IMU; its samples go through sdimu compensate first.",
    "white noise: sigma of a mean over T seconds = density / sqrt(T);",
    "random walk: sigma of the bias's change in T seconds = random walk * sqrt(T).",
    "Random walks: of --imu, else learned, else of the IMU file; 0 is not known: set it before use.",
)


def kalibr_texts(source: Source) -> dict[str, str]:
    """Return the text of Kalibr's file for ``--imu``."""
    lines = [*_comments(source), *noise_lines(source), "rostopic: /imu/data", f"update_rate: {number(source.rate_hz)}"]
    return {"": "\n".join(lines) + "\n"}


def gtsam_texts(source: Source) -> dict[str, str]:
    """Return the text of GTSAM's metadata: names, numbers, and below them what the reader passes over."""
    imu, dt = source.imu, 1.0 / source.rate_hz
    walks = (imu.accel_random_walk * math.sqrt(dt), imu.gyro_random_walk * math.sqrt(dt))
    values = (*(0.0,) * 6, imu.accel_white_noise, imu.gyro_white_noise, 0.0, *walks, dt)
    lines = [
        _GTSAM,
        " ".join(map(number, values)),
        *_comments(source),
        "# GTSAM: AccelerometerSigma m/s^2/sqrt(Hz), GyroscopeSigma rad/s/sqrt(Hz); each bias sigma is the random walk",
        "# times sqrt(AverageDeltaT): that of the bias's change over one sample.",
    ]
    return {"": "\n".join(lines) + "\n"}


def cannot_hold(linear: LinearModel) -> list[str]:
    """Say what is left out: everything but the noise."""
    del linear
    return ["every coefficient (the program gets samples that went through sdimu compensate)"]


def no_walk(terms: Sequence[NoiseTerm]) -> list[str]:
    """Say which noise that a calibration learned is no random walk, and has no place in a form of densities."""
    return [f"{term.words} (the form states random walks alone)" for term in terms if term.kind != RANDOM_WALK]


def _comments(source: Source) -> list[str]:
    missing = [f"NOT IN THIS FILE: {text}" for text in source.missing]
    return [f"# {one_line(line, None)}" for line in (*_EQUATIONS, *missing)]
