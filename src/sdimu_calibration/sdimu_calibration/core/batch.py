"""The second estimator: least squares over the whole recording at once. The yardstick of the filter.

While the table rests, the attitude is one unknown rotation and the means of the samples say all they can. Between two
rests the IMU integrates a rotation, a velocity and a position, which must lead from one rest to the next. So
the unknowns are

    attitude of every stop (3), velocity and position that the stop really has (3 + 3, nearly zero), coefficients (p)

and the equations, all whitened,

    mean rate  - C_bn w_ie - D c = noise        one row a block of rest
    mean force + C_bn g    - D c = noise
    (attitude, velocity, position) after a motion - those integrated through it = 9 x 9 noise of the motion
    velocity and position of a stop = 0 +- the model's sigmas; priors of coefficients and initial attitude.

The noise of each rotation is thereby estimated with the rest. Nothing goes step by step here: no Kalman filter, no
error dynamics, no shared noise to model. Gauss-Newton until the coefficients stand still.

Shared with the filter: geometry (rotation, Earth, strapdown integration) and the regressors of the effects.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from sdimu_calibration.core import body_frame, earth
from sdimu_calibration.core.alignment import Alignment
from sdimu_calibration.core.batch_data import Layout, Travel, error_slope, layout, rest_means, travel
from sdimu_calibration.core.calibrate import data_counts
from sdimu_calibration.core.coarse import coarse_start
from sdimu_calibration.core.chain import Link, Solution, solve
from sdimu_calibration.core.motion import Motion
from sdimu_calibration.core.passes import Progress, Reduced, Setup, first_attitude, reduce, set_up
from sdimu_calibration.core.recording import DataError, Recording
from sdimu_calibration.core.results import Calibration, History
from sdimu_calibration.core.rotation import rotation_matrix, rotation_vector, skew
from sdimu_calibration.core.specification import ImuSpecification, Model, Site
from sdimu_calibration.core.track import motion

Floats = NDArray[np.float64]

CONVERGED = 1e-2
"""Largest step of a coefficient in its sigma at which Gauss-Newton ends."""
MOST_STEPS = 30
_PER_STOP = 9
"""Unknowns of a stop: attitude, velocity, position."""


@dataclass(frozen=True)
class Fit:
    """Where Gauss-Newton ended.

    Attributes
    ----------
    coefficients : ndarray, shape (p,)
        Frame of the prior.
    covariance : ndarray, shape (p, p)
    C_nb : ndarray, shape (k, 3, 3)
        Attitude of every stop.
    chi2 : float
        Sum of squares of all whitened rows, priors too.
    dof : int
    log_evidence : float
        Logarithm of the probability density of the data.
    steps : int
    """

    coefficients: Floats
    covariance: Floats
    C_nb: Floats
    chi2: float
    dof: int
    log_evidence: float
    steps: int


@dataclass(frozen=True)
class _Point:
    """Where the equations are linearised."""

    coefficients: Floats
    C_nb: Floats
    velocity: Floats
    position: Floats


def batch_calibrate(
    recording: Recording, site: Site, imu: ImuSpecification, model: Model, progress: Progress | None = None
) -> Calibration:
    """Calibrate an IMU from one recording by batch least squares.

    Parameters
    ----------
    recording : Recording
    site : Site
    imu : ImuSpecification
    model : Model
    progress : callable, optional
        Called with a word and the fraction done.

    Returns
    -------
    Calibration
        Without history; ``nis_mean`` is chi-square per degree of freedom of the whole fit.

    Raises
    ------
    DataError
        When the recording or the options cannot be used, or an effect changes at random by itself.
    """
    setup = set_up(site, imu, model)
    reduced = reduce(recording, setup)
    start = first_attitude(reduced.epochs, reduced.phases, setup)
    found = fit(reduced, setup, start, progress=progress)
    names, frame = setup.sensors.names, model.body_frame
    J = body_frame.frame_jacobian(names, frame)
    return Calibration(
        body_frame=frame,
        model=tuple(e.name for e in setup.sensors.effects),
        names=names,
        units=tuple(p.unit for p in setup.sensors.parameters),
        display_units=tuple(p.display_unit for p in setup.sensors.parameters),
        values=body_frame.values_in_frame(names, found.coefficients, frame),
        covariance=J @ found.covariance @ J.T,
        fit={
            "log_likelihood": found.log_evidence,
            "nis_mean": found.chi2 / max(found.dof, 1),
            "nis_dof": float(found.dof),
            "held_out_rms": None,
            "passes": float(found.steps),
        },
        data=data_counts(recording, reduced),
        notes=recording.notes,
        history=no_history(len(names)),
    )


def no_history(p: int) -> History:
    """History of an estimator that has none: no rows of `p` coefficients."""
    none = np.zeros(0)
    flags = np.zeros(0, dtype=bool)
    rows = np.zeros((0, p))
    return History(none, rows, rows, np.zeros((0, 3)), np.zeros(0, dtype=np.int64), flags, flags, np.zeros((0, 4)))


def bound_covariance(reduced: Reduced, setup: Setup, start: Alignment) -> Floats:
    """Covariance (p, p), frame of the prior, that the data of a perfect recording hold."""
    point, where = _begin(reduced, setup, start.C_nb, np.zeros(len(setup.sensors.prior)))
    return _scaled(solve(_links(reduced, setup, start, where, point)[0]), setup)[1]


def fit(reduced: Reduced, setup: Setup, start: Alignment, progress: Progress | None = None) -> Fit:
    """Gauss-Newton from the coarse start.

    Raises
    ------
    DataError
        When an effect of the model changes at random by itself, or the steps do not end.
    """
    coarse = coarse_start(reduced, setup, start)
    point, where = _begin(reduced, setup, coarse.C_nb, coarse.coefficients)
    for steps in range(1, MOST_STEPS + 1):
        if progress is not None:
            progress("least squares", min(0.95, 0.2 * steps))
        links, log_weight = _links(reduced, setup, start, where, point)
        solution = solve(links)
        step, covariance = _scaled(solution, setup)
        if not np.isfinite(step).all():
            break
        before, point = point, _moved(point, step, solution.links)
        if _movement(setup, before, point, covariance) < CONVERGED:
            evidence = log_weight - 0.5 * solution.chi2 - 0.5 * solution.dof * np.log(2.0 * np.pi) - solution.log_det
            return Fit(
                point.coefficients, covariance, point.C_nb, solution.chi2, solution.dof, float(evidence), steps
            )
    raise DataError(
        "batch least squares does not converge: the recording contradicts the IMU's specification; "
        "check --imu and --site"
    )


def _begin(reduced: Reduced, setup: Setup, C_nb: Floats, coefficients: Floats) -> tuple[_Point, Layout]:
    """Begin at an initial attitude and coefficients, with the other attitudes by the gyros alone."""
    changing = (setup.sensors.decay_rate > 0) | (setup.sensors.drive > 0)
    if changing.any():
        name = setup.sensors.names[int(np.argmax(changing))]
        raise DataError(f"the batch estimator takes constants only, and '{name}' changes at random; use the filter")
    where = layout(reduced)
    k = len(where.stop_first)
    point = _Point(coefficients, np.repeat(C_nb[None], k, axis=0), np.zeros((k, 3)), np.zeros((k, 3)))
    seen = _seen(reduced, setup, where, point)
    for i, gone in enumerate(_travels(reduced, setup, where, point, seen, setup.sensors.regressors(seen), chained=True)):
        point.C_nb[i + 1] = gone.C_nb
    return point, where


def _seen(reduced: Reduced, setup: Setup, where: Layout, point: _Point) -> Motion:
    """Motion that the attitudes of the stops predict.

    Gyros integrated over the whole test drift; so every turn starts from the attitude of its stop, and at rest the
    table stands as the stop does.
    """
    latitude = setup.site.latitude_rad
    seen = motion(
        reduced.cycles, reduced.rest, setup.sensors, point.coefficients, point.C_nb[0].copy(), latitude, setup.gravity,
        reduced.temperature, predicted=True,
    )  # fmt: skip
    cycle = np.arange(len(reduced.cycles))
    stop = np.maximum(np.searchsorted(where.stop_first, cycle, side="right") - 1, 0)
    drift = point.C_nb @ np.transpose(seen.C_nb[where.stop_last - 1], (0, 2, 1))
    at_stop = (cycle >= where.stop_first[stop]) & (cycle < where.stop_last[stop])
    C_nb = np.where(at_stop[:, None, None], point.C_nb[stop], drift[stop] @ seen.C_nb)
    w_earth = np.einsum("kij,i->kj", C_nb, earth.earth_rate(latitude))
    moving = ~reduced.rest[:, None]
    w_table = np.where(moving, seen.w - w_earth, 0.0)
    f = np.where(moving, seen.f, -setup.gravity * C_nb[:, 2, :])
    return replace(seen, C_nb=C_nb, w_table=w_table, w=w_earth + w_table, f=f)


def _travels(
    reduced: Reduced, setup: Setup, where: Layout, point: _Point, seen: Motion, values: Floats, chained: bool = False
) -> list[Travel]:
    """Integrate every motion, from the attitude of its stop or (`chained`) from where the last one ended."""
    site = setup.site
    excess = setup.gravity - float(earth.normal_gravity(site.latitude_rad, site.height_m))
    out: list[Travel] = []
    for k in range(len(where.stop_first) - 1):
        C_nb = out[-1].C_nb if chained and out else point.C_nb[k]
        rows = slice(int(where.stop_last[k]), int(where.stop_first[k + 1]))
        slope = error_slope(setup.sensors, seen, rows, point.coefficients)
        out.append(travel(
            reduced, rows, setup.sensors, values, slope, point.coefficients, C_nb, site.latitude_rad,
            site.height_m, excess, (setup.imu.gyro_white_noise**2, setup.imu.accel_white_noise**2),
        ))  # fmt: skip
    return out


def _links(
    reduced: Reduced, setup: Setup, start: Alignment, where: Layout, point: _Point
) -> tuple[list[Link], float]:
    """Whitened rows of all stops at a point, coefficients in units of their priors; the log of all weights."""
    prior, p = setup.sensors.prior, len(setup.sensors.prior)
    seen = _seen(reduced, setup, where, point)
    values = setup.sensors.regressors(seen)
    slope = error_slope(setup.sensors, seen, where.block_first, point.coefficients)
    rest = rest_means(reduced, where, setup.sensors, values)
    travels = _travels(reduced, setup, where, point, seen, values)
    weights = _rest_weights(setup, rest.seconds)
    dt = np.concatenate([[0.0], np.cumsum(reduced.cycles.dt)])
    links, log_weight = [], float(np.sum(np.log(weights))) - float(np.sum(np.log(prior)))
    for k in range(len(where.stop_first)):
        rows = where.block_stop == k
        residual, by_attitude = _rest_residual(setup, rest.mean[rows], slope[rows], point.C_nb[k])
        residual = residual - rest.design[rows] @ point.coefficients
        w = weights[rows]
        own = np.zeros((6 * len(w), _PER_STOP))
        own[:, :3] = (w[:, :, None] * by_attitude).reshape(-1, 3)
        parts = [(own, -(w[:, :, None] * rest.design[rows] * prior).reshape(-1, p), (w * residual).ravel())]
        parts.append(_still(setup, point.velocity[k], point.position[k], p))
        log_weight -= 3.0 * float(np.log(setup.model.velocity_sigma) + np.log(setup.model.position_sigma))
        if k == 0:
            parts.append(_initial(start, point.C_nb[0], p))
            parts.append((np.zeros((p, _PER_STOP)), np.eye(p), point.coefficients / prior))
            log_weight -= float(np.sum(np.log(start.filter_sigma)))
        step = _nothing(p)
        if k < len(travels):
            resting = dt[where.stop_last[k]] - dt[where.stop_first[k]]
            step, weight = _step(travels[k], point, k, resting, prior)
            log_weight += weight
        a, b, c = (np.concatenate(column) for column in zip(*parts, strict=True))
        links.append(Link(a, b, c, *step))
    return links, log_weight


def _rest_weights(setup: Setup, seconds: Floats) -> Floats:
    """One over sigma of the means of each block, shape (b, 6)."""
    rate = (setup.imu.gyro_white_noise**2 + setup.model.extra_rate_sigma**2) / seconds
    force = (setup.imu.accel_white_noise**2 + setup.model.extra_force_sigma**2) / seconds
    return 1.0 / np.sqrt(np.repeat(np.column_stack([rate, force]), 3, axis=1))


def _rest_residual(setup: Setup, mean: Floats, slope: Floats, C_nb: Floats) -> tuple[Floats, Floats]:
    """Measured minus predicted means (b, 6) of a perfect IMU, and their change per small turn in n (b, 6, 3).

    With C turned by a: C_bn v becomes C_bn (v - a x v); `slope` (b, 6, 6) of the errors goes with it.
    """
    w_ie, g_n = earth.earth_rate(setup.site.latitude_rad), np.array([0.0, 0.0, setup.gravity])
    residual = mean - np.concatenate([C_nb.T @ w_ie, -C_nb.T @ g_n])
    change = -np.vstack([C_nb.T @ skew(w_ie), -C_nb.T @ skew(g_n)])
    return residual, change + slope @ change


def _still(setup: Setup, velocity: Floats, position: Floats, p: int) -> tuple[Floats, Floats, Floats]:
    """Say that a stop stands still at the known point."""
    sigma = np.repeat([setup.model.velocity_sigma, setup.model.position_sigma], 3)
    own = np.zeros((6, _PER_STOP))
    own[:, 3:] = np.diag(1.0 / sigma)
    return own, np.zeros((6, p)), np.concatenate([velocity, position]) / sigma


def _initial(start: Alignment, C_nb: Floats, p: int) -> tuple[Floats, Floats, Floats]:
    """Say that the first attitude is the alignment's within its sigma."""
    own = np.zeros((3, _PER_STOP))
    own[:, :3] = np.diag(1.0 / start.filter_sigma)
    return own, np.zeros((3, p)), rotation_vector(C_nb @ start.C_nb.T) / start.filter_sigma


def _step(
    gone: Travel, point: _Point, k: int, resting: float, prior: Floats
) -> tuple[tuple[Floats, Floats, Floats, Floats], float]:
    """Whitened rows from stop k to the next, and the log of their weight."""
    L = np.linalg.cholesky(gone.noise)
    seconds = resting + gone.seconds
    own = np.zeros((9, _PER_STOP))
    own[:, :3] = -gone.by_attitude
    own[3:6, 3:6] = own[6:9, 6:9] = -np.eye(3)
    own[6:9, 3:6] = -seconds * np.eye(3)
    residual = np.concatenate([
        rotation_vector(point.C_nb[k + 1] @ gone.C_nb.T),
        point.velocity[k + 1] - point.velocity[k] - gone.moved[:3],
        point.position[k + 1] - point.position[k] - seconds * point.velocity[k] - gone.moved[3:],
    ])  # fmt: skip
    white = np.linalg.solve(L, np.hstack([own, np.eye(9), -gone.by_coefficient * prior, residual[:, None]]))
    rows = (white[:, :9], white[:, 9:18], white[:, 18:-1], white[:, -1])
    return rows, -float(np.sum(np.log(np.diag(L))))


def _nothing(p: int) -> tuple[Floats, Floats, Floats, Floats]:
    return np.zeros((0, _PER_STOP)), np.zeros((0, _PER_STOP)), np.zeros((0, p)), np.zeros(0)


def _scaled(solution: Solution, setup: Setup) -> tuple[Floats, Floats]:
    """Step and covariance of the coefficients in SI."""
    prior = setup.sensors.prior
    return solution.common * prior, solution.covariance * np.outer(prior, prior)


def _movement(setup: Setup, before: _Point, after: _Point, covariance: Floats) -> float:
    """Largest movement of a coefficient in its own sigma, in the frame that the accelerometers define.

    In the frame of the prior three rotations of the body are held by priors alone; they go on turning for long, and no
    reported number feels it.
    """
    names, frame = setup.sensors.names, "accelerometer_triad"
    J = body_frame.frame_jacobian(names, frame)
    sigma = np.sqrt(np.diag(J @ covariance @ J.T))
    old, new = (body_frame.values_in_frame(names, at.coefficients, frame) for at in (before, after))
    free = sigma > 1e-9 * setup.sensors.prior
    return float(np.max(np.abs(new - old)[free] / sigma[free]))


def _moved(point: _Point, step: Floats, links: Floats) -> _Point:
    turns = np.ascontiguousarray(links[:, :3])
    C_nb = np.array([rotation_matrix(turn) @ C for turn, C in zip(turns, point.C_nb, strict=True)])
    return _Point(
        point.coefficients + step, C_nb, point.velocity + links[:, 3:6], point.position + links[:, 6:9]
    )
