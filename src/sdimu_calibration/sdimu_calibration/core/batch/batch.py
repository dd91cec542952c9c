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

from sdimu_calibration.core import earth
from sdimu_calibration.core.alignment.alignment import Alignment, levelled
from sdimu_calibration.core.alignment.coarse_alignment import coarse_start
from sdimu_calibration.core.alignment.prepared import PreparedData, TestSetup
from sdimu_calibration.core.alignment.rest_means import Layout, layout, rest_means
from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.batch.batch_rows import (
    PER_STOP,
    LinearisationPoint,
    initial,
    rest_residual,
    rest_weights,
    step_rows,
    still,
)
from sdimu_calibration.core.batch.chain import Link, Solution, solve
from sdimu_calibration.core.batch.preintegration import arrival, preintegrate
from sdimu_calibration.core.effects import body_frame
from sdimu_calibration.core.effects.error_slope import error_slope
from sdimu_calibration.core.effects.motion import Motion
from sdimu_calibration.core.fit_statistics import FitStatistics
from sdimu_calibration.core.navigation.track import Correction, motion
from sdimu_calibration.core.progress import Progress
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.rotation import rotation_matrix
from sdimu_calibration.core.wording import Option

CONVERGED = 1e-2
"""Largest step of a coefficient (sigma) at which Gauss-Newton ends: smaller ones change no report."""
MOST_STEPS = 40
"""Number of steps at most: a fit that needs more does not converge."""
_NEAR = 1.0
"""Step (sigma) that ends the first stage: the second one begins near enough then."""
_LOOSE = (1e-2, 1.0)
"""Velocity and position sigma of the first stage (m/s, m): too wide to hold a wrong azimuth."""
_ALIKE, _CREEPING, _LONGEST = 0.95, 0.5, 30.0
"""Cosine between two steps, ratio of their sizes, largest factor of a stretch: steps that point alike and shrink by
less than half creep, and are stretched."""


@dataclass(frozen=True)
class BatchSolution:
    """Where Gauss-Newton ended."""

    coefficients: Floats
    """Frame of the prior, shape (p,)."""
    covariance: Floats
    """Shape (p, p)."""
    C_nb: Floats
    """Attitude of every stop, shape (k, 3, 3)."""
    statistics: FitStatistics
    """Of all whitened rows, priors too; the likelihood is the probability density of the data."""


def bound_covariance(prepared: PreparedData, setup: TestSetup, start: Alignment) -> Floats:
    """Return the covariance that the data of a perfect recording hold.

    Returns
    -------
    ndarray, shape (p, p)
        SI, in the frame of the prior.
    """
    point, where = _begin(prepared, setup, start.C_nb, np.zeros(len(setup.sensors.prior)))
    return _scaled(solve(_links(prepared, setup, start, where, point)[0], PER_STOP), setup)[1]


def solve_batch(prepared: PreparedData, setup: TestSetup, start: Alignment, progress: Progress) -> BatchSolution:
    """Gauss-Newton from the coarse start.

    First with stops that need not stand quite still: far from the solution the second order of large errors is much
    more than the sigma of a stop's velocity, and would be taken for knowledge.
    """
    coarse = coarse_start(prepared, setup, start)
    point, where = _begin(prepared, setup, coarse.C_nb, coarse.coefficients)
    loose = replace(setup, model=replace(setup.model, velocity_sigma=_LOOSE[0], position_sigma=_LOOSE[1]))
    taken = 0
    for stage, near in ((loose, _NEAR), (setup, CONVERGED)):
        last, moved = np.zeros(len(setup.sensors.prior)), np.inf
        while moved > near:
            taken += 1
            progress("least squares", min(0.95, 0.1 * taken))
            links, log_weight = _links(prepared, stage, start, where, point)
            solution = solve(links, PER_STOP)
            step, covariance = _scaled(solution, stage)
            if not np.isfinite(step).all() or taken > MOST_STEPS:
                raise DataError(
                    "batch least squares does not converge: the recording contradicts the IMU's specification; "
                    f"check {Option.IMU} and {Option.SITE}"
                )
            stretch = _stretch(step / setup.sensors.prior, last / setup.sensors.prior)
            last = np.zeros_like(step) if stretch > 1.0 else step
            before, point = point, _moved(point, stretch * step, stretch * solution.links)
            moved = _movement(setup, before, point, covariance)
    evidence = log_weight - 0.5 * solution.chi2 - 0.5 * solution.dof * np.log(2.0 * np.pi) - solution.log_det
    nis, dof = solution.chi2 / max(solution.dof, 1), float(solution.dof)
    statistics = FitStatistics(float(evidence), nis, dof, float(taken))
    return BatchSolution(point.coefficients, covariance, point.C_nb, statistics)


def _begin(
    prepared: PreparedData, setup: TestSetup, C_nb: Floats, coefficients: Floats
) -> tuple[LinearisationPoint, Layout]:
    """Begin at an initial attitude and coefficients; gyros lead from stop to stop, and every stop is levelled."""
    changing = (setup.sensors.decay_rate > 0) | (setup.sensors.drive > 0)
    if changing.any():
        name = setup.sensors.names[int(np.argmax(changing))]
        raise DataError(f"the batch estimator takes constants only, and '{name}' changes at random; use the filter")
    where = layout(prepared)
    k = len(where.stop_first)
    point = LinearisationPoint(coefficients, np.repeat(C_nb[None], k, axis=0), np.zeros((k, 3)), np.zeros((k, 3)))
    seen = _seen(prepared, setup, where, point)
    values = setup.sensors.regressors(seen)
    rest = rest_means(prepared, where, setup.sensors, values)
    force = (rest.mean - rest.design @ coefficients)[:, 3:]
    for i in range(k - 1):
        arrived = arrival(prepared, _motion_after(where, i), setup, values, coefficients, point.C_nb[i])
        point.C_nb[i + 1] = levelled(arrived, force[where.block_stop == i + 1].mean(axis=0))
    return point, where


def _seen(prepared: PreparedData, setup: TestSetup, where: Layout, point: LinearisationPoint) -> Motion:
    """Motion that the attitudes of the stops predict.

    Gyros integrated over the whole test drift; so every turn starts from the attitude of its stop, and at rest the
    table stands as the stop does.
    """
    latitude = setup.site.latitude_rad
    cycle = np.arange(len(prepared.cycles))
    stop = np.maximum(np.searchsorted(where.stop_first, cycle, side="right") - 1, 0)
    at_stop = (cycle >= where.stop_first[stop]) & (cycle < where.stop_last[stop])
    # Rest that is part of a travel (settling) counts as motion here: what is seen must follow the samples there, as
    # their derivatives do.
    seen = motion(
        prepared.cycles,
        at_stop,
        Correction(setup.sensors, point.coefficients),
        point.C_nb[0].copy(),
        setup.around(prepared.temperature),
        predicted=True,
    )
    drift = point.C_nb @ np.transpose(seen.C_nb[where.stop_last - 1], (0, 2, 1))
    C_nb = np.where(at_stop[:, None, None], point.C_nb[stop], drift[stop] @ seen.C_nb)
    w_earth = np.einsum("kij,i->kj", C_nb, earth.earth_rate(latitude))
    moving = ~at_stop[:, None]
    w_table = np.where(prepared.rest[:, None], 0.0, seen.w - w_earth)
    w = np.where(moving, seen.w, w_earth)
    f = np.where(moving, seen.f, -setup.gravity * C_nb[:, 2, :])
    return replace(seen, C_nb=C_nb, w_table=w_table, w=w, f=f, rest=prepared.rest)


def _motion_after(where: Layout, k: int) -> slice:
    """Cycles of the motion from stop k to the next."""
    return slice(int(where.stop_last[k]), int(where.stop_first[k + 1]))


def _links(
    prepared: PreparedData, setup: TestSetup, start: Alignment, where: Layout, point: LinearisationPoint
) -> tuple[list[Link], float]:
    """Whitened rows of all stops at a point, coefficients in units of their priors; the log of all weights."""
    prior, p = setup.sensors.prior, len(setup.sensors.prior)
    seen = _seen(prepared, setup, where, point)
    values = setup.sensors.regressors(seen)
    slope = error_slope(setup.sensors, seen, where.block_first, point.coefficients)
    rest = rest_means(prepared, where, setup.sensors, values)
    weights = rest_weights(setup, rest.seconds)
    dt = np.concatenate([[0.0], np.cumsum(prepared.cycles.dt)])
    links, log_weight = [], float(np.sum(np.log(weights))) - float(np.sum(np.log(prior)))
    for k in range(len(where.stop_first)):
        rows = where.block_stop == k
        residual, by_attitude = rest_residual(setup, rest.mean[rows], slope[rows], point.C_nb[k])
        residual = residual - rest.design[rows] @ point.coefficients
        w = weights[rows]
        resting = np.zeros((6 * len(w), PER_STOP + p + 1))
        resting[:, :3] = (w[:, :, None] * by_attitude).reshape(-1, 3)
        resting[:, PER_STOP:-1] = -(w[:, :, None] * rest.design[rows] * prior).reshape(-1, p)
        resting[:, -1] = -(w * residual).ravel()
        own = [resting, still(setup, point.velocity[k], point.position[k], p)]
        log_weight -= 3.0 * float(np.log(setup.model.velocity_sigma) + np.log(setup.model.position_sigma))
        if k == 0:
            own.append(initial(start, point.C_nb[0], p))
            white = np.linalg.inv(np.linalg.cholesky(setup.sensors.correlation))
            known = -(white @ (point.coefficients / prior))[:, None]
            own.append(np.hstack([np.zeros((p, PER_STOP)), white, known]))
            log_weight += float(np.sum(np.log(np.diag(white)))) - float(np.sum(np.log(start.filter_sigma)))
        step = np.zeros((0, 2 * PER_STOP + p + 1))
        if k + 1 < len(where.stop_first):
            motion_after = _motion_after(where, k)
            gone = preintegrate(prepared, motion_after, setup, seen, values, point.coefficients, point.C_nb[k])
            step, weight = step_rows(gone, point, k, dt[where.stop_last[k]] - dt[where.stop_first[k]], prior)
            log_weight += weight
        links.append(Link(np.vstack(own), step))
    return links, log_weight


def _scaled(solution: Solution, setup: TestSetup) -> tuple[Floats, Floats]:
    """Step and covariance of the coefficients in SI."""
    prior = setup.sensors.prior
    return solution.common * prior, solution.covariance * np.outer(prior, prior)


def _stretch(step: Floats, last: Floats) -> float:
    """Factor that takes a creeping step to where the geometric series of such steps ends (Aitken).

    With errors of percents the turn of the prior's body frame creeps: nothing but second order of the model holds it.
    """
    product, before = float(step @ last), float(last @ last)
    if not before or product < _ALIKE * np.sqrt(before * float(step @ step)):
        return 1.0
    ratio = product / before
    return float(1.0 / (1.0 - ratio)) if _CREEPING < ratio < 1.0 - 1.0 / _LONGEST else 1.0


def _movement(setup: TestSetup, before: LinearisationPoint, after: LinearisationPoint, covariance: Floats) -> float:
    """Largest movement of a coefficient in its own sigma, in the frame that the accelerometers define.

    In the frame of the prior three rotations of the body are held by priors alone; they go on turning for long, and no
    reported number feels it.
    """
    names, frame = setup.sensors.names, "accelerometer_triad"
    J = body_frame.jacobian_at(names, after.coefficients, frame)
    sigma = np.sqrt(np.diag(J @ covariance @ J.T))
    old, new = (body_frame.values_in_frame(names, at.coefficients, frame) for at in (before, after))
    free = sigma > 1e-9 * setup.sensors.prior
    return float(np.max(np.abs(new - old)[free] / sigma[free]))


def _moved(point: LinearisationPoint, step: Floats, links: Floats) -> LinearisationPoint:
    turns = np.ascontiguousarray(links[:, :3])
    C_nb = np.array([rotation_matrix(turn) @ C for turn, C in zip(turns, point.C_nb, strict=True)])
    return LinearisationPoint(
        point.coefficients + step, C_nb, point.velocity + links[:, 3:6], point.position + links[:, 6:9]
    )
