"""Handheld multi-position calibration: any IMU, put into many attitudes by hand, without a site.

For sensors whose noise hides the Earth's rate navigation has nothing to hold on to: no north, and a velocity that is
unknown as soon as a hand moves the IMU. What is left is enough: at rest the force is gravity, whatever the attitude,
and from rest to rest the gyros must turn it as the accelerometers see it turned. One least squares over all rests and
turns (`handheld_fit`).

What is unknown without a site is noted, not guessed: the magnitude of gravity scales all accelerometers together,
so a convention takes its place (9.80665 m/s^2, or the site's); the Earth's rate is three more unknowns whose prior is
its size. The body frame is that of the accelerometers.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sdimu_calibration.core import earth
from sdimu_calibration.core.alignment.alignment import levelled
from sdimu_calibration.core.arrays import Bools
from sdimu_calibration.core.data.attitudes import turned_unseen
from sdimu_calibration.core.data.static_detection import StaticIntervals, detect_static
from sdimu_calibration.core.effects import body_frame
from sdimu_calibration.core.effects.bias import GYRO_BIAS
from sdimu_calibration.core.effects.imu_model import ImuModel
from sdimu_calibration.core.handheld.handheld_data import HandheldRun, reduce_run, turns
from sdimu_calibration.core.handheld.handheld_faults import without_impossible
from sdimu_calibration.core.handheld.handheld_fit import (
    FORCE,
    RATE,
    TURN,
    FitPriors,
    HandheldSolution,
    LinearisationPoint,
)
from sdimu_calibration.core.handheld.whole_turns import whole_turns, with_whole_turns
from sdimu_calibration.core.recording import DataError, DataFault, Recording
from sdimu_calibration.core.specification import ImuSpecification, Site
from sdimu_calibration.core.units import STANDARD_GRAVITY, from_si
from sdimu_calibration.core.wording import Option, Work

FEWEST_RESTS = 6
"""Number of rests at least: scale and bias of three accelerometers need as many attitudes."""
_UNKNOWN = 0.5
"""Share of the prior sigma above which a coefficient is called unknown: the recording has hardly told it."""
_LEAST_NOISE = 0.01
"""Share of the specification's noise below which learned noise is not believed: a few rests may agree by chance."""
_ROOM = 30.0
"""Factor on the prior of the class where the IMU's file gives none: held back by a prior, an added effect would be
learned as scatter."""
_SEEN = 3.0
"""Ratio of the Earth's rate to its sigma: from here on it is seen."""


@dataclass(frozen=True)
class PreparedRun:
    """A handheld recording, made ready: without impossible samples, its rests found, reduced.

    Attributes
    ----------
    recording : Recording
    rests : StaticIntervals
    run : HandheldRun
    impossible : tuple of DataFault
        What was taken out.
    """

    recording: Recording
    rests: StaticIntervals
    run: HandheldRun
    impossible: tuple[DataFault, ...]


def prepare_run(recording: Recording, whole_sigma: float = 0.0) -> PreparedRun:
    """Find the rests and reduce the recording to them and the turns between.

    Parameters
    ----------
    recording : Recording
    whole_sigma : float
        How well the IMU was put back after whole turns about the vertical (rad); 0 where none is stated.
    """
    recording, impossible = without_impossible(recording)
    rests = detect_static(recording)
    if len(rests) < FEWEST_RESTS:
        raise DataError(_too_few(recording, len(rests)))
    run = reduce_run(recording, rests)
    return PreparedRun(recording, rests, with_whole_turns(run, whole_sigma) if whole_sigma else run, impossible)


def _too_few(recording: Recording, count: int) -> str:
    rests = f"/imu/data_raw: {count} rest{'s' if count > 1 else ''}"
    if not turned_unseen(recording):
        return f"{rests}; a handheld calibration needs {FEWEST_RESTS} and more, in different attitudes"
    return (
        f"{rests} in different attitudes, and no turn between them is recorded: a handheld calibration needs "
        f"{FEWEST_RESTS} rests and more, a navigated one the turns. Record on while the IMU is turned, add attitudes, "
        f"or part the attitudes ({Work.CUT}) and calibrate them as a set: {Work.CALIBRATE} A B ..."
    )


def fit_priors(sensors: ImuModel, imu: ImuSpecification, site: Site | None, rests: StaticIntervals) -> FitPriors:
    """Say what is known before the fit."""
    changing = (sensors.decay_rate > 0) | (sensors.drive > 0)
    if changing.any():
        name = sensors.names[int(np.argmax(changing))]
        raise DataError(f"a handheld run takes constants only, and '{name}' changes at random: leave it out")
    # The prior holds in a frame of its own; the three turns that lead to the accelerometers' frame go with it.
    J = body_frame.frame_jacobian(sensors.names, "accelerometer_triad")
    size = sensors.prior * np.where(_stated(sensors, imu) | sensors.restated, 1.0, _ROOM)
    prior = J @ np.diag(size**2) @ J.T
    kept = np.flatnonzero(np.diag(prior) > 1e-12 * size**2)
    gravity, mean, sigma = STANDARD_GRAVITY, np.zeros(3), np.full(3, earth.RATE / np.sqrt(3.0))
    if site is not None:
        gravity = site.gravity_m_s2 or float(earth.normal_gravity(site.latitude_rad, site.height_m))
        rate = earth.earth_rate(site.latitude_rad)
        mean[2] = rate[2]
        # The heading is free, so north is any way; 1e-9 rad/s is a ten-thousandth of a degree an hour.
        down = max(1e-9, abs(rate[0]) * site.latitude_sigma_rad)
        sigma = np.array([abs(rate[0]) / np.sqrt(2.0) + 1e-9, abs(rate[0]) / np.sqrt(2.0) + 1e-9, down])
    return FitPriors(
        sensors,
        kept,
        prior[np.ix_(kept, kept)],
        gravity,
        mean,
        sigma,
        max(rests.gyro_white_noise, _LEAST_NOISE * imu.gyro_white_noise),
        max(rests.accel_white_noise, _LEAST_NOISE * imu.accel_white_noise),
    )


def _stated(sensors: ImuModel, imu: ImuSpecification) -> Bools:
    """Which coefficients have a prior in the IMU's own file."""
    return np.array([(e.family or e.name) in imu.prior for e in sensors.effects for _ in e.parameters])


def first_linearisation(run: HandheldRun, sensors: ImuModel, gravity: float) -> LinearisationPoint:
    """Begin with the mean rate at rest as bias; gyros lead from rest to rest, and every rest is levelled."""
    coefficients = np.zeros(len(sensors.prior))
    for name, value in zip(GYRO_BIAS.labels, np.median(run.mean[:, :3], axis=0), strict=True):
        if name in sensors.names:
            coefficients[sensors.names.index(name)] = value
    k = len(run.t)
    turned = turns(run, sensors, coefficients, np.repeat(np.eye(3)[None], k, axis=0), gravity).C_nb
    C_nb = [levelled(np.eye(3), run.mean[0, 3:])]
    for i in range(k - 1):
        C_nb.append(levelled(C_nb[-1] @ turned[i], run.mean[i + 1, 3:]))
    return LinearisationPoint(coefficients, np.array(C_nb), np.zeros(3), np.zeros(3))


def handheld_notes(run: HandheldRun, scene: FitPriors, found: HandheldSolution, site: Site | None) -> list[str]:
    """Say what was taken for granted, what was learned, and what stays unknown."""
    extra = found.point.extra
    out = [
        f"handheld: {len(run.t)} rests of {run.seconds.min():.1f} to {run.seconds.max():.1f} s; white noise at rest "
        f"{from_si(scene.gyro_white_noise, 'deg/h'):.3g} deg/h/sqrt(Hz), "
        f"{from_si(scene.accel_white_noise, 'ug'):.3g} ug/sqrt(Hz); beyond it force {from_si(extra[FORCE], 'ug'):.3g} "
        f"ug, rate {np.degrees(extra[RATE]):.2g} deg/s, turns {100.0 * extra[TURN]:.2g} % of the angle",
        _gravity_note(scene, site),
        _earth_note(found, site),
    ]
    out += _whole_note(run)
    sigma = np.sqrt(np.diag(found.covariance))
    names = [scene.model.names[i] for i in scene.kept][: len(scene.kept) - scene.model.serving]
    known = np.sqrt(np.diag(scene.prior))[: len(names)]
    unknown = [n for n, s, q in zip(names, sigma[: len(names)], known, strict=True) if s > _UNKNOWN * q]
    if unknown:
        out.append(f"not determined by this recording: {', '.join(unknown)}")
    return out


def _whole_note(run: HandheldRun) -> list[str]:
    """Say which turns were taken for whole ones, or might be."""
    if len(run.whole):
        size = np.degrees(run.whole_sigma)
        return [f"{len(run.whole)} turns are whole ones about the vertical, as stated, to {size:.2g} deg"]
    found = whole_turns(run)
    if not len(found):
        return []
    return [
        f"{len(found)} turns are about the vertical by nearly a multiple of 360 deg, which gravity does not show: if "
        f"the IMU was put back where it was, say how well, such as {Option.WHOLE_TURNS} '1 deg'"
    ]


def _gravity_note(scene: FitPriors, site: Site | None) -> str:
    source = "standard gravity, as no site is given" if site is None else "of the site"
    return (
        f"gravity {scene.gravity:.5f} m/s^2 ({source}); its error is a common error of all accelerometer scale factors"
    )


def _earth_note(found: HandheldSolution, site: Site | None) -> str:
    size = from_si(float(np.linalg.norm(found.point.earth)), "deg/h")
    sigma = from_si(float(np.sqrt(np.mean(found.earth_sigma**2))), "deg/h")
    if site is not None:
        return "Earth rate: vertical part of the site, north part estimated"
    seen = "seen" if size > _SEEN * sigma else "not seen"
    return f"Earth rate is estimated, as no site is given: {size:.2g} +- {sigma:.2g} deg/h, {seen} in this recording"
