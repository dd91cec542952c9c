"""What a compensation is worth in use: navigation without any aid, on a stretch of the recording that no fit has seen.

The coefficients come from the rest of the recording alone. In the dwell at which the stretch begins, the IMU
levels itself by its compensated accelerometers and is given its azimuth; then it navigates freely while the table turns
and rests. It never leaves the known point, so whatever it says of position and velocity is error. Height is held,
as an altimeter would.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, cast

import numpy as np

from sdimu_calibration.core.alignment.alignment import align, azimuth_of
from sdimu_calibration.core.alignment.prepared import PreparedData, TestSetup, first_attitude
from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.effects import bias
from sdimu_calibration.core.estimation.holdout import Segment, holdout_segments, part, unseen_segment
from sdimu_calibration.core.evidence.information import solved
from sdimu_calibration.core.evidence.navigation_evidence import NavigationEvidence
from sdimu_calibration.core.evidence.noise_kernels import Stretches
from sdimu_calibration.core.evidence.noise_root import root_of
from sdimu_calibration.core.evidence.signatures import Regressors
from sdimu_calibration.core.filter.filter_pass import COPY, NAV, PassInput, PassState, new_output, run_pass
from sdimu_calibration.core.filter.pass_loop import CONVERGED
from sdimu_calibration.core.filter.pass_setup import firm_setup, pass_input, pass_settings
from sdimu_calibration.core.filter.passes import motion_about, one_pass
from sdimu_calibration.core.measurement_kind import SENSORS, SKIP
from sdimu_calibration.core.navigation.correct_cycles import correct_cycles, spread
from sdimu_calibration.core.navigation.strapdown import Cycles, navigate
from sdimu_calibration.core.rotation import rotation_vector
from sdimu_calibration.core.side_by_side import side_by_side

if TYPE_CHECKING:
    # A fit that navigates takes its free navigations from here.
    from sdimu_calibration.core.estimation.navigation_fit import NavigationFit

NOTHING = "no compensation"
AS_GIVEN, FOUND = "model as given", "with what was found"
"""Names of the first model and of the last, where navigations without aid compare models."""
_WIDE_LEVEL = 1e-2
"""Sigma of the level before levelling (rad): nothing is known."""
_BLIND = 1.0
"""Variance of a measured rate ((rad/s)^2): so large that the rate says nothing."""
_MOST_PASSES = 4
"""Number of passes over a part from the fit of the whole: more than two or three mean that the fit is not near, and the
estimator finds the way by itself."""


@dataclass(frozen=True)
class Drift:
    """Errors of one free navigation, one row an epoch (k)."""

    name: str
    t: Floats
    """Seconds of navigation, shape (k,)."""
    position: Floats
    velocity: Floats
    """`position`, `velocity`: north and east (m, m/s), shape (k, 2)."""
    heading: Floats
    """Change of the azimuth error since the start (rad), shape (k,)."""
    promised: Floats
    """Shape (k,). One sigma of the horizontal distance that the fit itself expects (m); NaN where there is none."""

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
    """Free navigations of one segment."""

    segment: Segment
    drifts: tuple[Drift, ...]
    """Without compensation, then with each model."""
    recording: str = ""
    """Its name in a set; empty where there is one recording."""

    @property
    def ends(self) -> tuple[Drift, ...]:
        """The drifts without those of models between the first and the last."""
        return (*self.drifts[:2], *self.drifts[2:][-1:])


@dataclass(frozen=True)
class Refit:
    """A fit to a part of the recording."""

    fit: NavigationFit
    """Of the same model: how it takes errors out of samples."""
    estimate: Floats
    covariance: Floats
    """`estimate`, `covariance`: shapes (q,) and (q, q). Coefficients of the estimator by the part alone (SI); for a
    navigation with what noise with a memory adds there."""


def free_inertial_runs(fits: Sequence[tuple[str, NavigationFit]]) -> tuple[FreeInertialRun, ...]:
    """Navigate unseen segments uncompensated and with each model, fitted to the rest of the recording.

    Parameters
    ----------
    fits : sequence of (str, NavigationFit)
        Names and fits of the whole recording; each is fitted again to the rest. A model that lacks an effect has a
        wrong azimuth, too: all start from that of the last, which knows most.
    """
    whole = fits[-1][1]
    # Worked out here, or each thread would.
    _ = whole.known
    return tuple(side_by_side(lambda segment: _run(whole, fits, segment), holdout_segments(whole.prepared)))


def _run(whole: NavigationFit, fits: Sequence[tuple[str, NavigationFit]], segment: Segment) -> FreeInertialRun:
    seen = part(whole.prepared, *segment.seen)
    drifts = [_free_navigation(NOTHING, whole, None, segment)]
    for name, fit in fits:
        again = _refit(fit, seen, fit.last.output.C_nb[max(segment.seen[0] - 1, 0)])
        again = _in_noise(again, fit, segment.seen, segment.begin_s - segment.levelled_s, segment.end_s)
        drifts.append(_free_navigation(name, whole, again, segment))
    return FreeInertialRun(segment, tuple(drifts))


@dataclass(frozen=True)
class OfOthers:
    """Coefficients of a unit that other recordings tell, with one model."""

    model: str
    """What people call the model."""
    names: tuple[str, ...]
    """Of the coefficients that the others know, length P; those that the model lacks are zero."""
    values: Floats
    """Shape (P,). SI."""
    covariance: Floats
    """Shape (P, P). Of the coefficients in a power-on that the others have not seen."""


def navigation_with(fit: NavigationFit, others: Sequence[OfOthers]) -> FreeInertialRun:
    """Navigate the begin of a recording uncompensated and with what other recordings tell.

    Parameters
    ----------
    fit : NavigationFit
        Of the recording, with every coefficient of `others`: how errors are taken out, the azimuth at the start, and
        what heading is compared with. What it knows alone is used only where it serves the estimate (an unknown
        azimuth).

    Raises
    ------
    DataError
        Where the recording is too short.
    """
    segment = unseen_segment(fit.prepared)
    drifts = [_free_navigation(NOTHING, fit, None, segment)]
    for one in others:
        seen = _in_noise(_told(fit, one), fit, (0, 0), segment.begin_s, segment.end_s)
        drifts.append(_free_navigation(one.model, fit, seen, segment))
    return FreeInertialRun(segment, tuple(drifts))


def _told(fit: NavigationFit, others: OfOthers) -> Refit:
    """Put what others tell into the coefficients of a fit; faults of its recording alone are not known to them."""
    names, place = fit.setup.sensors.names, {name: k for k, name in enumerate(others.names)}
    known = np.array([k for k, name in enumerate(names) if name in place], dtype=np.int64)
    source = np.array([place[names[k]] for k in known], dtype=np.int64)
    estimate, covariance = np.zeros(len(names)), np.zeros((len(names), len(names)))
    estimate[known] = others.values[source]
    covariance[np.ix_(known, known)] = others.covariance[np.ix_(source, source)]
    serving = np.arange(fit.bare.coefficients, len(names))
    estimate[serving] = fit.estimate[serving]
    covariance[np.ix_(serving, serving)] = fit.estimate_covariance[np.ix_(serving, serving)]
    return Refit(fit, estimate, covariance)


def _in_noise(found: Refit, whole: NavigationFit, part: tuple[int, int], begin: float, end: float) -> Refit:
    """Let the covariance hold in a stretch of a recording, in the noise that the fit of the whole learned.

    The wander u of the biases, with signatures U and covariance K (`evidence.learned_noise`), bends a fit in white
    noise, and the biases of the stretch are not those of the part: least squares on the rows of the part are off by
    ``C W'U u``, the biases of the stretch by their share ``S u``, so the covariance grows by
    ``(S - C W'U) K (S - C W'U)'``.

    `part`: epochs of the fit, as a half-open range; `begin`, `end`: of the stretch (s), biases are constant over it.
    """
    if whole.noise is None:
        return found
    wander = whole.wander
    evidence = cast(NavigationEvidence, whole.bare).in_inner(wander.inner)
    q = len(evidence.weight)
    rows = (evidence.epoch >= part[0]) & (evidence.epoch < part[1])
    W = np.where(rows[:, None], evidence.W[:, :q], 0.0)
    R = root_of(whole.noise.terms, wander.cut)
    bent = solved(W.T @ W + np.diag(evidence.weight), wander.U.across(W) @ R)
    apart = _biases(evidence.names[:q], wander.cut, begin, end) @ R - bent
    return replace(found, covariance=found.covariance + apart @ apart.T)


def _biases(names: Sequence[str], cut: Stretches, begin: float, end: float) -> Floats:
    """Return the map from the mean errors of all stretches to the biases in a span of time, shape (q, 6 n)."""
    inside = np.clip(np.minimum(cut.end, end) - np.maximum(cut.start, begin), 0.0, None)
    share = inside / inside.sum()
    out = np.zeros((len(names), len(cut), 6))
    for channel, name in enumerate(bias.NAMES):
        if name in names:
            out[names.index(name), :, channel] = share
    return out.reshape(len(names), -1)


def _refit(fit: NavigationFit, seen: PreparedData, C_nb: Floats) -> Refit:
    """Fit a part of the recording, from the fit of the whole.

    The coefficients move by little, so a few passes from the known ones do. Each pass leaves a share of the error of
    the pass before, which two movements tell; passes end when what is left is below `CONVERGED` of a sigma. Where they
    do not end, the estimator goes on by itself.

    Parameters
    ----------
    C_nb : ndarray, shape (3, 3)
        Attitude at the start of the part (dimensionless), by the fit of the whole.
    """
    alignment = first_attitude(seen.epochs, seen.phases, fit.setup)
    estimate, before, firm = fit.estimate, np.inf, firm_setup(fit.setup)
    for count in range(_MOST_PASSES):
        done = one_pass(seen, firm, alignment, np.ascontiguousarray(C_nb), estimate)
        moved = float(np.max(np.abs(done.estimate - estimate) / np.sqrt(np.diag(done.covariance))))
        # The first movement also holds what the part does not know of the whole: of at most a sigma, a share is left.
        if count and moved**2 < CONVERGED * min(before, 1.0):
            return Refit(fit, done.estimate, done.covariance)
        estimate, C_nb, before = done.estimate, done.smoothed_start, moved
    own = fit.on(seen, C_nb)
    return Refit(own, own.estimate, own.estimate_covariance)


def _compensated(
    setup: TestSetup, prepared: PreparedData, estimate: Floats, C_start: Floats, end_of_fit: float
) -> tuple[Cycles, Regressors]:
    """Take the errors of the sensors out of all cycles, exactly; also how the cycles change with the coefficients.

    `estimate`: of the estimator (SI), shape (q,); `C_start` (3, 3): attitude at the start, b to n; `end_of_fit`: where
    the fit ended (s): a coefficient that fades is known there, and fades away from there.
    """
    sensors = setup.sensors
    constant = estimate * (sensors.decay_rate == 0.0)
    near = motion_about(prepared, setup, C_start, constant)
    clean = correct_cycles(prepared.cycles, near, sensors, constant)
    values, channel, parameter = spread(
        sensors.regressors(clean.seen), sensors.channel, sensors.parameter, clean.weight
    )
    cycles, fading = clean.cycles, estimate - constant
    if fading.any():
        left = np.exp(-np.outer(np.abs(clean.seen.t - end_of_fit), sensors.decay_rate[parameter]))
        errors = (values * left * fading[parameter]) @ np.eye(6)[channel] * cycles.dt[:, None]
        cycles = replace(cycles, alpha=cycles.alpha - errors[:, :3], upsilon=cycles.upsilon - errors[:, 3:])
    return cycles, Regressors(values, channel, parameter)


def _free_navigation(name: str, whole: NavigationFit, seen: Refit | None, segment: Segment) -> Drift:
    """Navigate a segment with the coefficients of a fit to the rest of the recording; None takes samples as they are.

    `whole`: of the whole recording, as some effects remember what was before the segment. It gives the azimuth at the
    start, and what heading is compared with.
    """
    prepared, setup, reference = whole.prepared, whole.setup, whole.known.output
    until = part(prepared, 0, segment.last)
    cycles, terms = until.cycles, None
    if seen is not None:
        end_of_fit = float(prepared.epochs.end[segment.seen[1] - 1])
        cycles, terms = _compensated(seen.fit.setup, until, seen.estimate, reference.C_nb[0].copy(), end_of_fit)
    clean = part(replace(until, cycles=cycles), segment.first, segment.last)
    levelling = segment.start - segment.first
    border = int(clean.epochs.last[levelling - 1])
    C_start = _aligned(clean.cycles, border, setup, reference.C_nb[segment.start - 1])
    place = setup.site.latitude_rad, setup.site.height_m, setup.gravity
    track, moved = navigate(clean.cycles[border:], C_start, *place, level=True)
    ends = clean.epochs.last[levelling:] - border
    rows = slice(segment.start, segment.last)
    azimuth = [rotation_vector(C @ R.T)[2] for C, R in zip(track[ends], reference.C_nb[rows], strict=True)]
    at_start = rotation_vector(C_start @ reference.C_nb[segment.start - 1].T)[2]
    t = prepared.epochs.end[rows] - prepared.epochs.end[segment.start - 1]
    promised = np.full(len(t), np.nan)
    if seen is not None and terms is not None:
        begin = int(prepared.epochs.first[segment.first])
        terms = terms._replace(values=np.ascontiguousarray(terms.values[begin:]))
        sigma_azimuth = float(reference.sigma[segment.start - 1, 8])
        promised = _promised(clean, seen, terms, levelling, C_start, sigma_azimuth)
    return Drift(name, t, moved[ends, 3:5], moved[ends, :2], np.asarray(azimuth) - at_start, promised)


def _aligned(cycles: Cycles, border: int, setup: TestSetup, C_reference: Floats) -> Floats:
    """Attitude (3, 3) at rest in the cycles before `border`: own level, azimuth of the reference."""
    length = float(cycles.dt[:border].sum())
    w_mean, f_mean = (v[:border].sum(axis=0) / length for v in (cycles.alpha, cycles.upsilon))
    site = replace(setup.site, initial_azimuth_rad=azimuth_of(C_reference))
    return align(w_mean, f_mean, length, site, setup.imu).C_nb


def _promised(
    clean: PreparedData, seen: Refit, terms: Regressors, levelling: int, C_start: Floats, sigma_azimuth: float
) -> Floats:
    """One sigma of the horizontal distance (m) that the covariance of the refit gives at the end of each epoch, (k,).

    The filter of the fit levels by Zf alone, with everything it knows of the coefficients, and then measures nothing.
    """
    setup, q = seen.fit.setup, len(seen.estimate)
    s = NAV + q + COPY
    P = np.zeros((s, s))
    P[NAV : NAV + q, NAV : NAV + q] = seen.covariance
    P[range(6, 9), range(6, 9)] = np.square([_WIDE_LEVEL, _WIDE_LEVEL, sigma_azimuth])
    settings = pass_settings(setup)._replace(extra_gyro=_BLIND)
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


def _input(segment: PreparedData, kind: int, terms: Regressors, rows: slice) -> PassInput:
    """Every epoch measures the same `kind`."""
    same = replace(segment, kind=np.full(len(segment.epochs), kind, dtype=np.int64))
    return pass_input(same, np.ascontiguousarray(terms.values[rows]), terms.channel, terms.parameter)
