"""Least squares of a handheld run: attitude of every rest, coefficients, the Earth's rate as it may be.

Unknowns: a small turn of every rest (3 each), the coefficients (p), the Earth's rate as a vector in n (3). Equations,
all whitened:

    force at rest  - (-g C_bn z) - D c               = noise of the mean, and what the model leaves over
    rate at rest   - C_bn w_e    - D c               = noise of the mean, and the wandering of the bias
    attitude of the next rest against the gyros' turn = noise over the turn, that wandering, and a share of the angle
    priors of the coefficients and of w_e; one free heading, held.

What is more than white noise is learned (`run_scatter`), or given where other recordings tell it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from sdimu_calibration.core.arrays import Floats, Ints
from sdimu_calibration.core.effects.error_slope import error_slope
from sdimu_calibration.core.effects.imu_model import ImuModel
from sdimu_calibration.core.fit_statistics import FitStatistics
from sdimu_calibration.core.handheld.handheld_data import HandheldRun, seen_at_rest, turns
from sdimu_calibration.core.handheld.run_scatter import RunScatter, learned, run_scatter
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.results import Rest
from sdimu_calibration.core.rotation import rotation_matrix, rotation_vector, skew
from sdimu_calibration.core.wording import Option

CONVERGED = 1e-3
"""Largest step of a coefficient (sigma) at which Gauss-Newton ends: smaller ones change no report."""
MOST_STEPS = 120
"""Number of steps at most: sigmas that trade along a ridge take many."""
_FREE = 8
"""Number of steps after which each learned sigma has a pace of its own: until then it goes where it was learned."""
_SLOWEST, _FASTEST, _FASTER = 0.5, 64.0, 1.5
"""Factors of the pace of the learned sigmas: half where they swing, faster and faster where two trade along a ridge."""
MOST_RESTS = 400
"""Number of rests at most: the least squares is dense, and a thousand unknowns take a second a step."""
_HEADING = 1e-6
"""Sigma that holds the heading of the first rest (rad): the heading is free and says nothing about any coefficient."""
OTHER_PRIORS = 4
"""Number of priors beside those of the coefficients: three of the Earth's rate, one of the heading."""
_SWINGS = 0.5
"""Negative cosine of the angle between two steps (1) from which they swing: steps that settle go on or turn aside."""


@dataclass(frozen=True)
class FitPriors:
    """What is known before the fit."""

    model: ImuModel
    kept: Ints
    """Shape (q,). Coefficients that are estimated; the others stay zero (they define the body frame)."""
    prior: Floats
    """Covariance of the kept ones, shape (q, q)."""
    gravity: float
    """Magnitude (m/s^2)."""
    earth_mean: Floats
    earth_sigma: Floats
    """`earth_mean`, `earth_sigma`: shape (3,). Prior of the Earth's rate in n (rad/s); the heading of n is free."""
    gyro_white_noise: float
    accel_white_noise: float
    """`gyro_white_noise`, `accel_white_noise`: densities."""


@dataclass(frozen=True)
class LinearisationPoint:
    """Where the equations stand."""

    coefficients: Floats
    """SI, shape (p,)."""
    C_nb: Floats
    """Attitudes of the rests (dimensionless), shape (k, 3, 3)."""
    earth: Floats
    """Earth's rate (rad/s), shape (3,)."""
    extra: Floats
    """Learned sigmas of force (m/s^2), rate (rad/s) and turn (rad per rad of way), shape (3,)."""


@dataclass(frozen=True)
class HandheldSolution:
    """Where the fit ended."""

    point: LinearisationPoint
    """``extra`` holds the learned sigmas: force (m/s^2), rate (rad/s), turn (rad per rad of way)."""
    covariance: Floats
    """Of the kept coefficients, shape (q, q)."""
    earth_sigma: Floats
    """Sigma of the Earth's rate after the fit (rad/s), shape (3,)."""
    statistics: FitStatistics
    """Marginal log-likelihood, mean squared residual over its redundancy, steps."""
    ahead: ForcesAhead
    rest_residual: Floats
    """Of the rests (SI), rates first, shape (k, 6)."""
    turn_residual: Floats
    """Of the turns (rad), shape (k - 1, 3)."""


def fit_run(
    run: HandheldRun, scene: FitPriors, start: LinearisationPoint, given: Floats | None = None
) -> HandheldSolution:
    """Gauss-Newton with the sigmas learned on the way.

    Parameters
    ----------
    given : ndarray, shape (3,), optional
        Sigmas beyond white noise, as of ``LinearisationPoint.extra``: they are taken instead of learned.
    """
    if len(run.t) > MOST_RESTS:
        raise DataError(
            f"/imu/data_raw: {len(run.t)} rests; a handheld run may have {MOST_RESTS}: cut the recording in parts"
        )
    scatter = scatter_of(run, scene)
    point = start if given is None else replace(start, extra=given)
    change, pace, last = np.zeros(3), 1.0, np.zeros(0)
    for steps in range(1, MOST_STEPS + 1):
        rows, residual = equations(run, scene, point)
        sigma = scatter.sigmas_of_step(point.extra)
        Q, R, white = _solve(rows, residual, sigma)
        step = np.asarray(-np.linalg.solve(R, Q.T @ white))
        free = 1.0 - np.sum(Q**2, axis=1)
        extra = learned(scatter, point.extra, residual + rows @ step, free) if given is None else given
        moved = float(np.max(np.abs(R[-len(scene.kept) - 3 : -3] @ step)))
        # A hundredth of a sigma that is known to a tenth; half steps, as weights and residuals chase each other.
        settled = bool(np.all(np.abs(extra - point.extra) <= 1e-2 * extra + 1e-12))
        change, before = extra - point.extra, change
        pace = _pace(pace, change, before) if steps > _FREE else 1.0
        extra = np.maximum(point.extra + pace * change, 0.0)
        # What hardly anything determines swings about its place by squares of the errors: the middle is nearer.
        half = steps > _FREE and float(step @ last) < -_SWINGS * float(np.linalg.norm(step) * np.linalg.norm(last))
        last = step
        point = _moved(replace(point, extra=extra), 0.5 * step if half else step, scene)
        if not np.isfinite(step).all():
            break
        if moved < CONVERGED and settled and steps > 2:
            return _finish(run, scene, scatter, point, steps)
    raise DataError(
        f"the handheld run does not fit any IMU of the specification: check the units, and that {Option.IMU} is as "
        "wide as the sensor's errors"
    )


def scatter_of(run: HandheldRun, scene: FitPriors) -> RunScatter:
    """Make the variances of all equations of a run."""
    return run_scatter(run, scene.gyro_white_noise, scene.accel_white_noise, len(scene.kept) + OTHER_PRIORS)


def _pace(pace: float, change: Floats, before: Floats) -> float:
    """Speed up what goes on in one direction, slow down what turns."""
    along = float(change @ before)
    if along > 0.5 * float(np.linalg.norm(change) * np.linalg.norm(before)):
        return min(pace * _FASTER, _FASTEST)
    return _SLOWEST


def _moved(point: LinearisationPoint, step: Floats, scene: FitPriors) -> LinearisationPoint:
    """Take a step."""
    q, k = len(scene.kept), len(point.C_nb)
    small = step[: 3 * k].reshape(k, 3)
    C_nb = np.array([rotation_matrix(a) @ C for a, C in zip(small, point.C_nb, strict=True)])
    coefficients = point.coefficients.copy()
    coefficients[scene.kept] += step[3 * k : 3 * k + q]
    return replace(point, coefficients=coefficients, C_nb=C_nb, earth=point.earth + step[-3:])


def equations(run: HandheldRun, scene: FitPriors, point: LinearisationPoint) -> tuple[Floats, Floats]:
    """Make the equations about a point.

    Unknowns in this order: turns of the rests, coefficients, Earth rate. Equations in this order: six of each rest,
    three of each turn, one of each whole turn, priors.

    Returns
    -------
    rows : ndarray, shape (m, u)
        Change of each residual per unit of each unknown (SI).
    residual : ndarray, shape (m,)
        SI; of priors whitened.
    """
    k, q = len(run.t), len(scene.kept)
    model = scene.model
    seen = seen_at_rest(run, point.C_nb, point.earth, scene.gravity)
    values = model.regressors(seen)
    slope = np.eye(6) + error_slope(model, seen, slice(None), point.coefficients)
    true = np.hstack([seen.w, seen.f])
    rest_residual = run.mean - true - model.errors(values, point.coefficients)
    gone = turns(run, model, point.coefficients, point.C_nb, scene.gravity)
    rows = np.zeros((9 * k - 3 + len(run.whole), 3 * k + q + 3))
    residual = np.zeros(len(rows))
    design = np.zeros((k, 6, len(model.prior)))
    for column, (channel, parameter) in enumerate(zip(model.channel, model.parameter, strict=True)):
        design[:, channel, parameter] += values[:, column]
    # C turned by a: C_bn v becomes C_bn (v - a x v) = C_bn (v + [v x] a).
    g_n = np.array([0.0, 0.0, -scene.gravity])
    for i in range(k):
        at, C_bn = slice(6 * i, 6 * i + 6), point.C_nb[i].T
        rows[at, 3 * i : 3 * i + 3] = -slope[i] @ np.vstack([C_bn @ skew(point.earth), C_bn @ skew(g_n)])
        rows[at, 3 * k : 3 * k + q] = -design[i][:, scene.kept]
        rows[at, -3:] = -slope[i][:, :3] @ C_bn
        residual[at] = rest_residual[i]
    for i in range(k - 1):
        at = slice(6 * k + 3 * i, 6 * k + 3 * i + 3)
        if run.unseen[i]:
            # Only the next heading, which nothing tells, is kept from being none.
            rows[at.stop - 1, [3 * i + 2, 3 * i + 5]] = -1.0, 1.0
            continue
        rows[at, 3 * i : 3 * i + 3] = -np.eye(3)
        rows[at, 3 * i + 3 : 3 * i + 6] = np.eye(3)
        reached = rotation_matrix(-run.turn_s[i] * point.earth) @ gone.C_nb[i]
        rows[at, 3 * k : 3 * k + q] = -gone.by_coefficient[i][:, scene.kept]
        rows[at, -3:] = run.turn_s[i] * np.eye(3)
        residual[at] = rotation_vector(point.C_nb[i + 1] @ reached.T)
    for row, i in enumerate(run.whole, start=9 * k - 3):
        rows[row, [3 * i + 2, 3 * i + 5]] = -1.0, 1.0
        residual[row] = rotation_vector(point.C_nb[i + 1] @ point.C_nb[i].T)[2]
    more, left = _priors(scene, point, rows.shape[1])
    return np.vstack([rows, more]), np.concatenate([residual, left])


def _priors(scene: FitPriors, point: LinearisationPoint, width: int) -> tuple[Floats, Floats]:
    """Whitened rows of what is known before."""
    q = len(scene.kept)
    rows, residual = np.zeros((q + OTHER_PRIORS, width)), np.zeros(q + OTHER_PRIORS)
    white = np.linalg.inv(np.linalg.cholesky(scene.prior))
    rows[:q, width - 3 - q : width - 3] = white
    residual[:q] = white @ point.coefficients[scene.kept]
    rows[q : q + 3, -3:] = np.diag(1.0 / scene.earth_sigma)
    residual[q : q + 3] = (point.earth - scene.earth_mean) / scene.earth_sigma
    rows[q + 3, 2] = 1.0 / _HEADING
    return rows, residual


def _solve(rows: Floats, residual: Floats, sigma: Floats) -> tuple[Floats, Floats, Floats]:
    """QR of the whitened rows, and the whitened residual."""
    Q, R = np.linalg.qr(rows / sigma[:, None])
    return np.asarray(Q), np.asarray(R), np.asarray(residual / sigma)


def _finish(
    run: HandheldRun, scene: FitPriors, scatter: RunScatter, point: LinearisationPoint, steps: int
) -> HandheldSolution:
    """Put the statistics together."""
    rows, residual = equations(run, scene, point)
    sigma = scatter.sigmas(point.extra)
    Q, R, white = _solve(rows, residual, sigma)
    k, q = len(run.t), len(scene.kept)
    inverse = np.linalg.inv(R)
    covariance = inverse @ inverse.T
    measured = scatter.measured
    log = -float(np.sum(np.log(sigma[measured]))) - 0.5 * int(measured.sum()) * np.log(2.0 * np.pi)
    # The determinant of the priors too: without it a coefficient more would count by its unit.
    log += float(np.sum(np.log(np.diag(np.linalg.inv(np.linalg.cholesky(scene.prior))))))
    log -= float(np.sum(np.log(scene.earth_sigma))) + float(np.sum(np.log(np.abs(np.diag(R)))))
    chi2, dof = float(np.sum(white[measured] ** 2)), float((1.0 - np.sum(Q**2, axis=1))[measured].sum())
    return HandheldSolution(
        point=point,
        covariance=covariance[3 * k : 3 * k + q, 3 * k : 3 * k + q],
        earth_sigma=np.sqrt(np.diag(covariance)[-3:]),
        statistics=FitStatistics(log - 0.5 * float(white @ white), chi2 / max(dof, 1.0), dof, float(steps)),
        ahead=forces_ahead(Q, white, sigma, k),
        rest_residual=residual[: 6 * k].reshape(k, 6),
        turn_residual=residual[6 * k : 9 * k - 3].reshape(k - 1, 3),
    )


def rests_with_residuals(run: HandheldRun, scene: FitPriors, found: HandheldSolution) -> tuple[Rest, ...]:
    """List the rests with what the fit leaves over at each, and on the way to it."""
    k = len(run.t)
    sigma = scatter_of(run, scene).sigmas(found.point.extra)
    at_rest, of_turn = sigma[: 6 * k].reshape(k, 6), sigma[6 * k : 9 * k - 3 : 3]
    none = np.full((1, 3), np.nan)
    turn = np.vstack([none, np.where(run.unseen[:, None], np.nan, found.turn_residual)])
    turn_sigma = np.concatenate([[np.nan], np.where(run.unseen, np.nan, of_turn)])
    start, end = run.t - 0.5 * run.seconds, run.t + 0.5 * run.seconds
    numbers = np.column_stack([start, end, found.rest_residual, turn, at_rest[:, 0], at_rest[:, 3], turn_sigma])
    ahead = zip(found.ahead.error.tolist(), found.ahead.sigma.tolist(), strict=True)
    return tuple(
        Rest(a, b, (wx, wy, wz), (fx, fy, fz), (n, e, d), rate, force, way, (ex, ey, ez), (sx, sy, sz))
        for (a, b, wx, wy, wz, fx, fy, fz, n, e, d, rate, force, way), ((ex, ey, ez), (sx, sy, sz)) in zip(
            numbers.tolist(), ahead, strict=True
        )
    )


class ForcesAhead(NamedTuple):
    """Prediction errors."""

    rms: float
    """Over the sigmas of the fit, correlations of the axes of a rest included (1)."""
    error: Floats
    sigma: Floats
    """`error`, `sigma`: measured less predicted, and what it scatters by with the noise of the fit (m/s^2),
    shape (k, 3)."""


def forces_ahead(Q: Floats, white: Floats, sigma: Floats, k: int) -> ForcesAhead:
    """Predict the force at each rest without it.

    Leaving rows out of a least squares needs no new fit: with H their part of the hat matrix the prediction error is
    ``(I - H)^-1 e`` with covariance ``(I - H)^-1`` (Belsley, Kuh & Welsch, *Regression Diagnostics*, section 2.1).

    Parameters
    ----------
    Q : ndarray, shape (m, u)
        Orthogonal factor of the whitened equations, those of the k rests first: rates, then forces of each.
    white : ndarray, shape (m,)
        Whitened residuals.
    sigma : ndarray, shape (m,)
        Of the equations (SI).
    """
    total, error, scatter = 0.0, np.zeros((k, 3)), np.zeros((k, 3))
    for i in range(k):
        at = slice(6 * i + 3, 6 * i + 6)
        inverse = _inverse(np.eye(3) - Q[at] @ Q[at].T)
        ahead = inverse @ white[at]
        total += float(white[at] @ ahead)
        error[i], scatter[i] = sigma[at] * ahead, sigma[at] * np.sqrt(np.diag(inverse))
    return ForcesAhead(float(np.sqrt(total / (3 * k))), error, scatter)


def _inverse(rest: Floats) -> Floats:
    """Invert ``I - H``, shape (3, 3), where a rest alone may tell a coefficient: what is left of it is rounding."""
    size, axes = np.linalg.eigh(rest)
    return np.asarray((axes / np.maximum(size, _LEAST_LEFT)) @ axes.T)


_LEAST_LEFT = 1e-12
"""Least share of a force (1) that the others do not predict: below it is the rounding of the factor."""
