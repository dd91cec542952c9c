"""Covariance simulation: the sigmas of a test before it is run.

The filter itself runs on the recording of a perfect IMU (`nominal`), so its covariance is to first order that of a real
test. No noise is drawn and nothing is estimated. Noise with a memory that the IMU file states is put in
afterwards (`stated_noise`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from sdimu_calibration.core.alignment.alignment import Alignment
from sdimu_calibration.core.alignment.prepared import PreparedData, TestSetup, first_attitude, reduce, set_up
from sdimu_calibration.core.arrays import Bools, Floats
from sdimu_calibration.core.effects import body_frame
from sdimu_calibration.core.effects.accelerometer_frame import as_asked
from sdimu_calibration.core.estimation.navigation_fit import NavigationFit
from sdimu_calibration.core.estimation.prepared_test import PreparedTest
from sdimu_calibration.core.filter.filter_pass import NAV
from sdimu_calibration.core.filter.passes import one_pass
from sdimu_calibration.core.plan import Plan
from sdimu_calibration.core.planning.noise_set import NoiseSet, apply
from sdimu_calibration.core.planning.nominal import nominal_recording
from sdimu_calibration.core.planning.observability import Combination, unobservable
from sdimu_calibration.core.planning.stated_noise import covariance_in
from sdimu_calibration.core.recording import Recording
from sdimu_calibration.core.rotation import rotation_matrix
from sdimu_calibration.core.specification import ImuSpecification, Model, Site
from sdimu_calibration.core.stated_noise import stated_noise

Bound = Callable[[PreparedData, TestSetup, Alignment], Floats]


@dataclass(frozen=True)
class Prediction:
    """Predicted sigmas of a plan for one IMU.

    Attributes
    ----------
    model : tuple of str
        Effects.
    names, units, display_units : tuple of str, length p
    sigma : ndarray, shape (p,)
        At the end of the test, SI, in `body_frame`.
    in_noise : ndarray, shape (p,)
        The same with bias instability and random walk of the IMU file; as `sigma` where it states none.
    bound : ndarray, shape (p,)
        Sigma that a batch of all data would reach in white noise.
    prior : ndarray, shape (p,)
    covariance : ndarray, shape (p, p)
    t : ndarray, shape (m,)
        Times (s) of the history.
    history : ndarray, shape (m, p)
        Sigma against time.
    attitude : ndarray, shape (m, 3)
        Attitude sigma N, E, D against time (rad).
    dwell : ndarray of bool, shape (m,)
    """

    body_frame: str
    duration_s: float
    model: tuple[str, ...]
    names: tuple[str, ...]
    units: tuple[str, ...]
    display_units: tuple[str, ...]
    sigma: Floats
    in_noise: Floats
    bound: Floats
    prior: Floats
    covariance: Floats
    t: Floats
    history: Floats
    attitude: Floats
    dwell: Bools
    unobservable: tuple[Combination, ...]


@dataclass(frozen=True)
class Nominal:
    """Prepared perfect recording of a plan, shared by all covariance simulations of it."""

    recording: Recording
    prepared: PreparedData
    setup: TestSetup
    start: Alignment

    @property
    def duration_s(self) -> float:
        """Length of the test (s)."""
        return float(self.recording.t[-1])


def prepare(
    plan: Plan, site: Site, imu: ImuSpecification, model: Model, mount_rad: Floats | None, noise: NoiseSet | None
) -> Nominal:
    """Record a plan with a perfect IMU and prepare it for the filter.

    Parameters
    ----------
    mount_rad : ndarray, shape (3,), or None
        Rotation vector of the IMU on the table (rad); None for zero.
    noise : NoiseSet or None
        Replaces the noise of IMU and model and the initial attitude.
    """
    told, weighed = (imu, model) if noise is None else apply(noise, imu, model)
    setup = set_up(site, told, weighed)
    recording = nominal_recording(plan, site, mount_rad)
    prepared = reduce(recording, setup, screened=False)
    start = first_attitude(prepared.epochs, prepared.phases, setup)
    C_nb = rotation_matrix(np.zeros(3) if mount_rad is None else np.asarray(mount_rad, dtype=float))
    sigma = start.filter_sigma
    if noise is not None:
        sigma = np.array([noise.level_sigma, noise.level_sigma, noise.azimuth_sigma])
    return Nominal(recording, prepared, setup, replace(start, C_nb=C_nb, filter_sigma=sigma))


def predict(
    plan: Plan,
    site: Site,
    imu: ImuSpecification,
    model: Model,
    mount_rad: Floats | None = None,
    noise: NoiseSet | None = None,
    bound: Bound | None = None,
) -> Prediction:
    """Simulate the covariance of a test.

    Parameters
    ----------
    imu : ImuSpecification
        Noise and priors.
    model : Model
        Effects and weights; the sigmas are given in its body frame.
    mount_rad : ndarray, shape (3,), optional
        Rotation vector of the IMU on the table (rad).
    noise : NoiseSet, optional
        Replaces the noise of IMU and model and the initial attitude.
    bound : callable, optional
        Gives the covariance (p, p), frame of the prior, that the data hold (`batch.bound_covariance`); NaN without.
    """
    nominal = prepare(plan, site, imu, model, mount_rad, noise)
    setup = nominal.setup
    sensors, frame = setup.sensors, setup.model.body_frame
    done = one_pass(nominal.prepared, setup, nominal.start, nominal.start.C_nb, np.zeros(len(sensors.prior)))
    J = body_frame.frame_jacobian(sensors.names, frame)
    output, epochs = done.output, nominal.prepared.epochs
    rows = np.arange(0, len(epochs), output.stride)
    variance = np.einsum("ij,kjl,il->ki", J, output.covariance[: len(rows)], J, optimize=True)
    covariance = J @ done.covariance @ J.T
    sigma = np.sqrt(np.diag(covariance))
    terms = () if noise is not None else stated_noise(imu)
    in_noise = sigma
    if terms:
        test = PreparedTest(nominal.recording, imu, site)
        fit = NavigationFit(
            test, model, sensors, setup, nominal.prepared, nominal.start, done, 1, as_asked(sensors, frame)
        )
        in_noise = np.sqrt(np.diag(J @ covariance_in(fit, terms) @ J.T))
    limit = np.full(len(sigma), np.nan)
    if bound is not None:
        # The bound depends on the noise of this IMU, not on the noise set of the filter.
        own = prepare(plan, site, imu, model, mount_rad, None)
        limit = np.sqrt(np.diag(J @ bound(own.prepared, own.setup, own.start) @ J.T))
    attitude = np.sqrt(np.diag(done.state.P)[-3:])
    return Prediction(
        body_frame=frame,
        duration_s=nominal.duration_s,
        model=tuple(e.key for e in sensors.effects),
        names=sensors.names,
        units=tuple(p.unit for p in sensors.parameters),
        display_units=tuple(p.display_unit for p in sensors.parameters),
        sigma=sigma,
        in_noise=in_noise,
        bound=limit,
        prior=sensors.prior,
        covariance=covariance,
        t=np.append(epochs.end[rows], epochs.end[-1]),
        history=np.vstack([np.sqrt(variance), sigma]),
        attitude=np.vstack([output.sigma[rows, 6:NAV], output.sigma[-1:, 6:NAV]]),
        dwell=np.append(nominal.prepared.phases.dwell[rows], nominal.prepared.phases.dwell[-1]),
        unobservable=unobservable(
            sensors.names, sensors.prior, done.covariance, nominal.start.filter_sigma, attitude, nominal.start.C_nb
        ),
    )


def largest_by_effect(prediction: Prediction) -> dict[str, float]:
    """Largest final sigma of each effect's parameters (SI): a row of Table 3.3 of Kim, Song & Lyou."""
    out: dict[str, float] = {}
    for effect in prediction.model:
        own = [s for n, s in zip(prediction.names, prediction.sigma, strict=True) if n.startswith(f"{effect}_")]
        out[effect] = float(max(own))
    return out
