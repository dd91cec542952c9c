"""What a pass is made from: its constants, its state at the first sample, its data."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sdimu_calibration.core import earth
from sdimu_calibration.core.alignment.alignment import Alignment
from sdimu_calibration.core.alignment.prepared import PreparedData, TestSetup
from sdimu_calibration.core.arrays import Floats, Ints
from sdimu_calibration.core.data.phases import restarts
from sdimu_calibration.core.filter.filter_pass import COPY, NAV, PassInput, PassSettings, PassState
from sdimu_calibration.core.filter.running_mean import share_of_rests
from sdimu_calibration.core.measurement_kind import SKIP
from sdimu_calibration.core.recording import DivergedError
from sdimu_calibration.core.rotation import rotation_vector
from sdimu_calibration.core.wording import Option

_LOOSE_VELOCITY = 1.0
"""Sigma of Zv (m/s) while the passes find their place: too wide to say anything."""
_LOOSE_POSITION = 100.0
"""Sigma of Zp (m) while the passes find their place: too wide to say anything."""
_FIRM = 0.05
"""Later sigmas of Zv and Zp at least, as a share of what white noise leaves in a motion of `_MOTION_S`: no less can be
told from zero, and a covariance that falls by more than ten digits loses its symmetry."""
_MOTION_S = 60.0
"""Length of a usual turn (s): at 2 deg/s one of 90 deg takes 45 s, one of 180 deg 90 s."""


NO_MEANS: Ints = np.empty((0, 2), dtype=np.int64)
"""Places of states that are means of others, shape (0, 2), dimensionless: none has noise with a memory."""


def pass_settings(setup: TestSetup, averaged: Ints = NO_MEANS) -> PassSettings:
    """Make the constants of a pass.

    Parameters
    ----------
    averaged : ndarray of int, shape (w, 2)
        Places of states of noise and of their means, as in `PassSettings` (dimensionless).
    """
    site, imu, model = setup.site, setup.imu, setup.model
    return PassSettings(
        reference=np.array([site.latitude_rad, 0.0, site.height_m]),
        gravity_excess=setup.gravity - float(earth.normal_gravity(site.latitude_rad, site.height_m)),
        gyro_psd=imu.gyro_white_noise**2,
        accel_psd=imu.accel_white_noise**2,
        extra_gyro=model.extra_rate_sigma**2,
        extra_accel=model.extra_force_sigma**2,
        velocity_sigma=model.velocity_sigma,
        position_sigma=model.position_sigma,
        decay_rate=setup.sensors.decay_rate,
        drive=setup.sensors.drive,
        shared_noise=model.shared_noise,
        shaken=setup.shaken,
        averaged=averaged,
    )


def start_state(setup: TestSetup, start: Alignment, C_nb: Floats, reference: Floats) -> PassState:
    """State at the first sample.

    Alignment and prior stay what they are; the state holds how far they lie from the point of linearisation.

    Parameters
    ----------
    start : Alignment
        Mean and sigma of the initial attitude.
    C_nb : ndarray, shape (3, 3)
        Attitude about which the pass is linearised, b to n.
    reference : ndarray, shape (p,)
        Coefficients about which it is linearised (SI).
    """
    p = len(setup.sensors.prior)
    s = NAV + p + COPY
    model = setup.model
    x, P = np.zeros(s), np.zeros((s, s))
    P[range(3), range(3)] = model.position_sigma**2
    P[range(3, 6), range(3, 6)] = model.velocity_sigma**2
    for i in range(3):
        for a in (6 + i, NAV + p + i):
            for b in (6 + i, NAV + p + i):
                P[a, b] = start.filter_sigma[i] ** 2
    P[NAV : NAV + p, NAV : NAV + p] = setup.sensors.prior_covariance
    shift = rotation_vector(C_nb @ start.C_nb.T)
    x[6:9] = x[NAV + p :] = -shift
    x[NAV : NAV + p] = setup.sensors.mean - reference
    position = np.array([setup.site.latitude_rad, 0.0, setup.site.height_m])
    return PassState(x, P, C_nb.copy(), np.zeros(3), position, reference.copy())


def no_shifts(epochs: int) -> tuple[Ints, Floats]:
    """Make the fields of a navigation that goes on from stop to stop as it is.

    Returns
    -------
    shift : ndarray of int, shape (e,)
    C_stop : ndarray, shape (0, 3, 3)
        As in `PassInput` (dimensionless).
    """
    return np.full(epochs, -1), np.empty((0, 3, 3))


def pass_input(prepared: PreparedData, values: Floats, channel: Ints, parameter: Ints) -> PassInput:
    """Put cycles, epochs and regressors together.

    Parameters
    ----------
    prepared : PreparedData
        n cycles.
    values : ndarray, shape (n, m)
        Regressors (SI).
    channel, parameter : ndarray of int, shape (m,)
        Sensor axis and coefficient of each regressor.

    Returns
    -------
    PassInput
        Of a navigation that goes on from stop to stop as it is.
    """
    c, e, b = prepared.cycles, prepared.epochs, prepared.bridges
    return PassInput(
        c.dt,
        c.alpha,
        c.upsilon,
        c.coning,
        c.sculling,
        e.first,
        e.last,
        b.white,
        b.angle,
        b.velocity,
        prepared.kind,
        restarts(e, prepared.phases) & (prepared.kind != SKIP),
        values,
        channel,
        parameter,
        *no_shifts(len(e)),
        share_of_rests(e.start, e.end, prepared.phases.dwell),
    )


def loosened(setup: TestSetup) -> TestSetup:
    """Let position and velocity go."""
    return replace(setup, model=replace(setup.model, velocity_sigma=_LOOSE_VELOCITY, position_sigma=_LOOSE_POSITION))


def firm_setup(setup: TestSetup) -> TestSetup:
    """Make the setup of passes that have found their place: Zv and Zp no tighter than can be told from zero."""
    model = setup.model
    velocity = _FIRM * setup.imu.accel_white_noise * float(np.sqrt(_MOTION_S))
    position = velocity * _MOTION_S / float(np.sqrt(3.0))
    return replace(
        setup,
        model=replace(
            model,
            velocity_sigma=max(model.velocity_sigma, velocity),
            position_sigma=max(model.position_sigma, position),
        ),
    )


def check_finite(state: PassState) -> None:
    """Refuse a pass that did not end in numbers.

    Raises
    ------
    DivergedError
        When the filter diverged.
    """
    if not (np.isfinite(state.x).all() and np.isfinite(state.P).all() and (np.diag(state.P) >= 0.0).all()):
        raise DivergedError(
            f"the filter diverged: the recording contradicts the IMU's specification; check {Option.IMU} and "
            f"{Option.SITE}, or add to the model what is far larger than its priors"
        )
