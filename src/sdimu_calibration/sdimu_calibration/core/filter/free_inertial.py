"""What a compensation is worth in use: navigation without any aid, on a stretch of the recording that no fit has seen.

The coefficients come from the rest of the recording alone. In the dwell at which the stretch begins, the IMU
levels itself by its compensated accelerometers and is told its azimuth; then it navigates freely while the table turns
and rests. It never leaves the known point, so whatever it says of position and velocity is error. Height is held,
as an altimeter would.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from sdimu_calibration.core import earth
from sdimu_calibration.core.alignment.alignment import align, azimuth_of
from sdimu_calibration.core.alignment.prepared import PreparedData, TestSetup
from sdimu_calibration.core.arrays import Floats, Ints
from sdimu_calibration.core.compiled import compiled
from sdimu_calibration.core.filter.filter_pass import NAV, PassInput, PassOutput, PassState, new_output, run_pass
from sdimu_calibration.core.filter.holdout import WANTED_S, Segment, holdout_segments, part
from sdimu_calibration.core.filter.passes import Pass, pass_input, pass_settings, solve
from sdimu_calibration.core.measurement_kind import SENSORS, SKIP
from sdimu_calibration.core.navigation.strapdown import Cycles, navigate_cycle, velocity_increment
from sdimu_calibration.core.navigation.track import motion
from sdimu_calibration.core.progress import silent
from sdimu_calibration.core.rotation import rotation_vector

NOTHING = "no compensation"
_WIDE_LEVEL = 1e-2
"""Sigma of the level before levelling (rad): nothing is known."""
_BLIND = 1.0
"""Variance that makes a measured rate say nothing ((rad/s)^2)."""


@dataclass(frozen=True)
class Drift:
    """Errors of one free navigation, one row an epoch (k).

    Attributes
    ----------
    name : str
        Of the compensation.
    t : ndarray, shape (k,)
        Seconds of navigation.
    position, velocity : ndarray, shape (k, 2)
        North and east (m, m/s).
    heading : ndarray, shape (k,)
        Change of the azimuth error since the start (rad).
    promised : ndarray, shape (k,)
        One sigma of the horizontal distance that the fit itself expects (m); NaN where there is none.
    """

    name: str
    t: Floats
    position: Floats
    velocity: Floats
    heading: Floats
    promised: Floats

    @property
    def distance(self) -> Floats:
        """Horizontal error of position (m), shape (k,)."""
        return np.asarray(np.hypot(self.position[:, 0], self.position[:, 1]))

    @property
    def speed(self) -> Floats:
        """Horizontal error of velocity (m/s), shape (k,)."""
        return np.asarray(np.hypot(self.velocity[:, 0], self.velocity[:, 1]))


@dataclass(frozen=True)
class FreeInertialRun:
    """Free navigations of one stretch: without compensation, then with each model."""

    stretch: Segment
    drifts: tuple[Drift, ...]


def in_use(
    prepared: PreparedData, setups: Sequence[tuple[str, TestSetup]], reference: PassOutput, wanted_s: float = WANTED_S
) -> tuple[FreeInertialRun, ...]:
    """Navigate unseen stretches uncompensated and with each model, fitted to the rest of the recording.

    Parameters
    ----------
    prepared : PreparedData
    setups : sequence of (str, TestSetup)
        Names and models.
    reference : PassOutput
        Of a fit to the whole recording: azimuth at the start, and what heading is compared with.
    wanted_s : float
        Length of the navigation (s).

    Raises
    ------
    DataError
        When there is no such stretch, or the rest of the recording cannot be calibrated.
    """
    return tuple(_trial(prepared, setups, reference, stretch) for stretch in holdout_segments(prepared, wanted_s))


def _trial(
    prepared: PreparedData, setups: Sequence[tuple[str, TestSetup]], reference: PassOutput, stretch: Segment
) -> FreeInertialRun:
    seen = part(prepared, *stretch.seen)
    fits = [(name, setup, solve(setup, seen, silent).last) for name, setup in setups]
    drifts = [free_navigation(NOTHING, prepared, *fits[0][1:], stretch, reference, compensated=False)]
    drifts += [free_navigation(name, prepared, setup, fit, stretch, reference) for name, setup, fit in fits]
    return FreeInertialRun(stretch, tuple(drifts))


def free_navigation(
    name: str,
    prepared: PreparedData,
    setup: TestSetup,
    fitted: Pass,
    stretch: Segment,
    reference: PassOutput,
    compensated: bool = True,
) -> Drift:
    """Navigate the stretch with the coefficients of `fitted`, or with none."""
    estimate = fitted.estimate if compensated else np.zeros_like(fitted.estimate)
    errors, values = _sensor_errors(prepared, setup, estimate, stretch, reference.C_nb[0])
    epochs = part(prepared, stretch.first, stretch.last)
    levelling = stretch.start - stretch.first
    border = int(epochs.epochs.last[levelling - 1])
    clean = _compensated(epochs.cycles, errors)
    C_start = _aligned(clean, border, setup, reference.C_nb[stretch.start - 1])
    position, velocity, C_nb = _navigated(clean, border, epochs.epochs.last[levelling:], setup, C_start)
    rows = slice(stretch.start, stretch.last)
    azimuth = [rotation_vector(C @ R.T)[2] for C, R in zip(C_nb, reference.C_nb[rows], strict=True)]
    at_start = rotation_vector(C_start @ reference.C_nb[stretch.start - 1].T)[2]
    t = prepared.epochs.end[rows] - prepared.epochs.end[stretch.start - 1]
    promised = np.full(len(t), np.nan)
    if compensated:
        sigma_azimuth = float(reference.sigma[stretch.start - 1, 8])
        promised = _promised(epochs, setup, fitted, values, levelling, C_start, sigma_azimuth)
    return Drift(name, t, position, velocity, np.asarray(azimuth) - at_start, promised)


def _sensor_errors(
    prepared: PreparedData, setup: TestSetup, estimate: Floats, stretch: Segment, C_start: Floats
) -> tuple[Floats, Floats]:
    """Sensor errors (n, 6) and regressors of the cycles of the stretch.

    The motion is that of the whole recording, some effects remember what was before; it starts at rest, where the
    attitude does not change.
    """
    sensors = setup.sensors
    seen = motion(
        prepared.cycles, prepared.rest, sensors, estimate, C_start.copy(), setup.site.latitude_rad, setup.gravity,
        prepared.temperature, predicted=False,
    )  # fmt: skip
    begin, end = int(prepared.epochs.first[stretch.first]), int(prepared.epochs.last[stretch.last - 1])
    values = sensors.regressors(seen)[begin:end]
    # What fades is known where the fit ended, and fades away from there.
    since = np.abs(seen.t[begin:end] - float(prepared.epochs.end[stretch.seen[1] - 1]))
    fading = np.exp(-np.outer(since, sensors.decay_rate[sensors.parameter]))
    return sensors.errors(values * fading, estimate), np.ascontiguousarray(values)


def _compensated(cycles: Cycles, errors: Floats) -> Cycles:
    dt = cycles.dt[:, None]
    return replace(cycles, alpha=cycles.alpha - errors[:, :3] * dt, upsilon=cycles.upsilon - errors[:, 3:] * dt)


def _aligned(cycles: Cycles, border: int, setup: TestSetup, C_reference: Floats) -> Floats:
    """Attitude (3, 3) at rest in the cycles before `border`: own level, azimuth of the reference."""
    length = float(cycles.dt[:border].sum())
    w_mean, f_mean = (v[:border].sum(axis=0) / length for v in (cycles.alpha, cycles.upsilon))
    site = replace(setup.site, initial_azimuth_rad=azimuth_of(C_reference))
    return align(w_mean, f_mean, length, site, setup.imu).C_nb


def _navigated(
    cycles: Cycles, border: int, last: Ints, setup: TestSetup, C_start: Floats
) -> tuple[Floats, Floats, Floats]:
    """Navigate from cycle `border` on; errors of position and velocity (k, 2) and attitudes at the cycles `last`."""
    site = setup.site
    free = cycles[border:]
    start = np.array([site.latitude_rad, 0.0, site.height_m])
    excess = setup.gravity - float(earth.normal_gravity(site.latitude_rad, site.height_m))
    place, velocity, C_nb = _navigate(
        C_start.copy(), start.copy(), np.ascontiguousarray(free.alpha), np.ascontiguousarray(free.upsilon),
        free.coning, free.sculling, free.dt, last - border, excess,
    )  # fmt: skip
    r_n, r_e = earth.radii(site.latitude_rad)
    north = (place[:, 0] - start[0]) * (r_n + site.height_m)
    east = place[:, 1] * (r_e + site.height_m) * np.cos(min(abs(site.latitude_rad), earth.POLE_LIMIT))
    return np.column_stack([north, east]), velocity[:, :2], C_nb


@compiled
def _navigate(
    C_nb: Floats,
    position: Floats,
    alpha: Floats,
    upsilon: Floats,
    coning: Floats,
    sculling: Floats,
    dt: Floats,
    last: Ints,
    gravity_excess: float,
) -> tuple[Floats, Floats, Floats]:
    """Position (rad, rad, m), velocity and attitude after the cycles ``last - 1``; height held; starts at rest."""
    k = last.shape[0]
    place, speed, attitude = np.empty((k, 3)), np.empty((k, 3)), np.empty((k, 3, 3))
    velocity = np.zeros(3)
    height = position[2]
    c = 0
    for e in range(k):
        while c < last[e]:
            gravity = earth.normal_gravity(position[0], height) + gravity_excess
            dv = velocity_increment(alpha[c], upsilon[c], sculling[c])
            navigate_cycle(C_nb, velocity, position, alpha[c] + coning[c], dv, dt[c], gravity)
            velocity[2], position[2] = 0.0, height
            c += 1
        place[e], speed[e], attitude[e] = position, velocity, C_nb
    return place, speed, attitude


def _promised(
    stretch: PreparedData,
    setup: TestSetup,
    fitted: Pass,
    values: Floats,
    levelling: int,
    C_start: Floats,
    sigma_azimuth: float,
) -> Floats:
    """One sigma of the horizontal distance (m) that the covariance of the fit gives at the end of each epoch, (k,).

    The filter of the fit levels by Zf alone, with everything it knows of the coefficients, and then measures nothing.
    """
    p = len(setup.sensors.prior)
    s = fitted.state.P.shape[0]
    P = np.zeros((s, s))
    P[NAV : NAV + p, NAV : NAV + p] = fitted.covariance
    P[range(6, 9), range(6, 9)] = np.square([_WIDE_LEVEL, _WIDE_LEVEL, sigma_azimuth])
    settings = pass_settings(setup, closed_loop=False)._replace(extra_gyro=_BLIND)
    place = np.array([setup.site.latitude_rad, 0.0, setup.site.height_m])
    state = PassState(np.zeros(s), P, C_start.copy(), np.zeros(3), place.copy(), fitted.estimate.copy())
    border, count = int(stretch.epochs.last[levelling - 1]), len(stretch.epochs) - levelling
    resting, free = part(stretch, 0, levelling), part(stretch, levelling, len(stretch.epochs))
    run_pass(_input(resting, SENSORS, setup, values[:border]), settings, state, new_output(levelling, p, False, count))
    # Navigation starts from the known point.
    P = state.P.copy()
    P[:6, :] = P[:, :6] = 0.0
    state = PassState(np.zeros(s), P, C_start.copy(), np.zeros(3), place, fitted.estimate.copy())
    out = new_output(count, p, False, count)
    run_pass(_input(free, SKIP, setup, values[border:]), settings, state, out)
    return np.asarray(np.hypot(out.sigma[:, 0], out.sigma[:, 1]))


def _input(stretch: PreparedData, kind: int, setup: TestSetup, values: Floats) -> PassInput:
    """Every epoch measures the same `kind`."""
    same = replace(stretch, kind=np.full(len(stretch.epochs), kind, dtype=np.int64))
    return pass_input(same, np.ascontiguousarray(values), setup.sensors.channel, setup.sensors.parameter)
