"""What a compensation is worth in use: navigation without any aid, on a stretch of the recording that no fit has seen.

The coefficients come from the rest of the recording alone. In the dwell at which the stretch begins, the IMU
levels itself by its compensated accelerometers and is given its azimuth; then it navigates freely while the table turns
and rests. It never leaves the known point, so whatever it says of position and velocity is error. Height is held,
as an altimeter would.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple, Protocol

import numpy as np

from sdimu_calibration.core import earth
from sdimu_calibration.core.alignment.alignment import align, azimuth_of
from sdimu_calibration.core.alignment.prepared import PreparedData, TestSetup
from sdimu_calibration.core.arrays import Floats, Ints
from sdimu_calibration.core.compiled import compiled
from sdimu_calibration.core.estimation.holdout import WANTED_S, Segment, holdout_segments, part
from sdimu_calibration.core.filter.filter_pass import COPY, NAV, PassInput, PassOutput, PassState, new_output, run_pass
from sdimu_calibration.core.filter.passes import pass_input, pass_settings
from sdimu_calibration.core.measurement_kind import SENSORS, SKIP
from sdimu_calibration.core.navigation.strapdown import Cycles, navigate_cycle, velocity_increment
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

    segment: Segment
    drifts: tuple[Drift, ...]


class Compensated(NamedTuple):
    """Cycles without the sensor errors of a fit, and how they change with its coefficients.

    Shapes: n cycles, m columns, q coefficients of the estimator.
    """

    cycles: Cycles
    values: Floats  # (n, m) regressors of the corrected cycles (SI)
    channel: Ints  # (m,)
    parameter: Ints  # (m,)


class Navigator(Protocol):
    """What free navigation needs of a fit."""

    @property
    def setup(self) -> TestSetup:
        """Site, IMU and sensor model, as the estimator has them."""

    @property
    def estimate(self) -> Floats:
        """Coefficients of the estimator (SI), shape (q,)."""

    @property
    def estimate_covariance(self) -> Floats:
        """Their covariance, shape (q, q)."""

    def on(self, prepared: PreparedData, C_nb: Floats) -> Navigator:
        """Fit the same model to a part of the recording that starts at attitude `C_nb` (3, 3)."""

    def compensated(self, prepared: PreparedData, estimate: Floats, C_start: Floats, end_of_fit: float) -> Compensated:
        """Take the errors at `estimate` (q,) out of all cycles; the fit ended at `end_of_fit` (s)."""


def free_inertial_runs(
    prepared: PreparedData, fits: Sequence[tuple[str, Navigator]], reference: PassOutput, wanted_s: float = WANTED_S
) -> tuple[FreeInertialRun, ...]:
    """Navigate unseen segments uncompensated and with each model, fitted to the rest of the recording.

    Parameters
    ----------
    prepared : PreparedData
    fits : sequence of (str, Navigator)
        Names and fits of the whole recording; each is fitted again to the rest.
    reference : PassOutput
        Of a fit to the whole recording: azimuth at the start, and what heading is compared with.
    wanted_s : float
        Length of the navigation (s).

    Raises
    ------
    DataError
        When there is no such segment, or the rest of the recording cannot be calibrated.
    """
    return tuple(_run(prepared, fits, reference, segment) for segment in holdout_segments(prepared, wanted_s))


def _run(
    prepared: PreparedData, fits: Sequence[tuple[str, Navigator]], reference: PassOutput, segment: Segment
) -> FreeInertialRun:
    first = segment.seen[0]
    C_nb = reference.C_nb[max(first - 1, 0)]
    seen = part(prepared, *segment.seen)
    again = [(name, fit.on(seen, C_nb)) for name, fit in fits]
    drifts = [free_navigation(NOTHING, prepared, again[0][1], segment, reference, compensated=False)]
    drifts += [free_navigation(name, prepared, fit, segment, reference) for name, fit in again]
    return FreeInertialRun(segment, tuple(drifts))


def free_navigation(
    name: str, prepared: PreparedData, fit: Navigator, segment: Segment, reference: PassOutput,
    compensated: bool = True,
) -> Drift:  # fmt: skip
    """Navigate a segment with the coefficients of a fit, or with none.

    Parameters
    ----------
    name : str
    prepared : PreparedData
        Of the whole recording: some effects remember what was before the segment.
    fit : Navigator
        Of the rest of the recording.
    segment : Segment
    reference : PassOutput
    compensated : bool
    """
    estimate = fit.estimate if compensated else np.zeros_like(fit.estimate)
    end_of_fit = float(prepared.epochs.end[segment.seen[1] - 1])
    whole = fit.compensated(prepared, estimate, reference.C_nb[0].copy(), end_of_fit)
    clean = part(replace(prepared, cycles=whole.cycles), segment.first, segment.last)
    levelling = segment.start - segment.first
    border = int(clean.epochs.last[levelling - 1])
    C_start = _aligned(clean.cycles, border, fit.setup, reference.C_nb[segment.start - 1])
    position, velocity, C_nb = _navigated(clean.cycles, border, clean.epochs.last[levelling:], fit.setup, C_start)
    rows = slice(segment.start, segment.last)
    azimuth = [rotation_vector(C @ R.T)[2] for C, R in zip(C_nb, reference.C_nb[rows], strict=True)]
    at_start = rotation_vector(C_start @ reference.C_nb[segment.start - 1].T)[2]
    t = prepared.epochs.end[rows] - prepared.epochs.end[segment.start - 1]
    promised = np.full(len(t), np.nan)
    if compensated:
        begin, end = int(prepared.epochs.first[segment.first]), int(prepared.epochs.last[segment.last - 1])
        terms = whole._replace(cycles=clean.cycles, values=np.ascontiguousarray(whole.values[begin:end]))
        sigma_azimuth = float(reference.sigma[segment.start - 1, 8])
        promised = _promised(clean, fit, terms, levelling, C_start, sigma_azimuth)
    return Drift(name, t, position, velocity, np.asarray(azimuth) - at_start, promised)


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
    clean: PreparedData, fit: Navigator, terms: Compensated, levelling: int, C_start: Floats, sigma_azimuth: float
) -> Floats:
    """One sigma of the horizontal distance (m) that the covariance of the fit gives at the end of each epoch, (k,).

    The filter of the fit levels by Zf alone, with everything it knows of the coefficients, and then measures nothing.
    """
    setup, q = fit.setup, len(fit.estimate)
    s = NAV + q + COPY
    P = np.zeros((s, s))
    P[NAV : NAV + q, NAV : NAV + q] = fit.estimate_covariance
    P[range(6, 9), range(6, 9)] = np.square([_WIDE_LEVEL, _WIDE_LEVEL, sigma_azimuth])
    settings = pass_settings(setup, closed_loop=False)._replace(extra_gyro=_BLIND)
    place = np.array([setup.site.latitude_rad, 0.0, setup.site.height_m])
    known = np.zeros(q)
    state = PassState(np.zeros(s), P, C_start.copy(), np.zeros(3), place.copy(), known.copy())
    border, count = int(clean.epochs.last[levelling - 1]), len(clean.epochs) - levelling
    resting, free = part(clean, 0, levelling), part(clean, levelling, len(clean.epochs))
    levelled = _input(resting, SENSORS, terms, slice(0, border))
    run_pass(levelled, settings, state, new_output(levelling, q, False, count))
    # Navigation starts from the known point.
    P = state.P.copy()
    P[:6, :] = P[:, :6] = 0.0
    state = PassState(np.zeros(s), P, C_start.copy(), np.zeros(3), place, known)
    out = new_output(count, q, False, count)
    run_pass(_input(free, SKIP, terms, slice(border, None)), settings, state, out)
    return np.asarray(np.hypot(out.sigma[:, 0], out.sigma[:, 1]))


def _input(segment: PreparedData, kind: int, terms: Compensated, rows: slice) -> PassInput:
    """Every epoch measures the same `kind`."""
    same = replace(segment, kind=np.full(len(segment.epochs), kind, dtype=np.int64))
    return pass_input(same, np.ascontiguousarray(terms.values[rows]), terms.channel, terms.parameter)
