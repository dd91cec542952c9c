"""Least squares of a handheld run: attitude of every rest, coefficients, the Earth's rate as it may be.

Unknowns: a small turn of every rest (3 each), the coefficients (p), the Earth's rate as a vector in n (3). Equations,
all whitened:

    force at rest  - (-g C_bn z) - D c               = noise of the mean, and what the model leaves over
    rate at rest   - C_bn w_e    - D c               = noise of the mean, and the wandering of the bias
    attitude of the next rest against the gyros' turn = noise over the turn, that wandering, and a share of the angle
    priors of the coefficients and of w_e; one free heading, held.

What is more than the white noise is not specified by anybody for a cheap IMU in a hand, so three sigmas are learned:
each is as large as makes the squared residuals of its equations as many as their redundancy (the moment estimate of
Paule & Mandel, J. Res. NBS 87, 1982; for least squares, Koch, *Parameter Estimation and Hypothesis Testing in Linear
Models*, section 3.6).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from sdimu_calibration.core.arrays import Bools, Floats, Ints
from sdimu_calibration.core.effects.error_slope import error_slope
from sdimu_calibration.core.effects.imu_model import ImuModel
from sdimu_calibration.core.handheld.forces_ahead import ForcesAhead, forces_ahead
from sdimu_calibration.core.handheld.handheld_data import HandheldRun, seen_at_rest, turns
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
_SWINGS = 0.5
"""Negative cosine of the angle between two steps (1) from which they swing: steps that settle go on or turn aside."""
_HEADING_STEP = 1e-3
"""Sigma of a step of a heading that nothing tells (rad): small enough to hold it, large enough to invert."""
_BISECTIONS = 50
"""Number of halvings: to rounding."""

FORCE, RATE, TURN, WHOLE = 0, 1, 2, 3
"""The kinds of equation; the scatter of the first three is learned, that of whole turns is stated."""


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
    chi2: float
    dof: float
    log_likelihood: float
    ahead: ForcesAhead
    rest_residual: Floats
    """Of the rests (SI), rates first, shape (k, 6)."""
    turn_residual: Floats
    """Of the turns (rad), shape (k - 1, 3)."""
    steps: int


def fit_run(run: HandheldRun, scene: FitPriors, start: LinearisationPoint) -> HandheldSolution:
    """Gauss-Newton with the sigmas learned on the way."""
    if len(run.t) > MOST_RESTS:
        raise DataError(
            f"/imu/data_raw: {len(run.t)} rests; a handheld run may have {MOST_RESTS}: cut the recording in parts"
        )
    point = start
    change, pace, last = np.zeros(3), 1.0, np.zeros(0)
    for steps in range(1, MOST_STEPS + 1):
        rows, residual, kind = equations(run, scene, point)
        # A heading after a turn that nobody saw stays where it is: the Earth tells it so badly that no search for it
        # ends, and what it is wrong by is learned as scatter of the rates.
        sigma = np.where(_unseen(run, kind), _HEADING_STEP, row_sigmas(run, scene, kind, point.extra))
        Q, R, white = _solve(rows, residual, sigma)
        step = np.asarray(-np.linalg.solve(R, Q.T @ white))
        extra = _learn(run, scene, kind, point.extra, rows, residual, step)
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
            return _finish(run, scene, point, steps)
    raise DataError(
        f"the handheld run does not fit any IMU of the specification: check the units, and that {Option.IMU} is as "
        "wide as the sensor's errors"
    )


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


def equations(run: HandheldRun, scene: FitPriors, point: LinearisationPoint) -> tuple[Floats, Floats, Ints]:
    """Make the equations about a point.

    Unknowns in this order: turns of the rests, coefficients, Earth rate. Equations in this order: six of each rest,
    three of each turn, one of each whole turn, priors.

    Returns
    -------
    rows : ndarray, shape (m, u)
        Change of each residual per unit of each unknown (SI).
    residual : ndarray, shape (m,)
        SI; of priors whitened.
    kind : ndarray of int, shape (m,)
        `FORCE`, `RATE`, `TURN` or `WHOLE`; -1 for priors.
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
    kind = np.concatenate(
        [
            np.tile([RATE] * 3 + [FORCE] * 3, k),
            np.full(3 * (k - 1), TURN),
            np.full(len(run.whole), WHOLE),
            np.full(q + 4, -1),
        ]
    )
    more, left = _priors(scene, point, rows.shape[1])
    return np.vstack([rows, more]), np.concatenate([residual, left]), kind


def _priors(scene: FitPriors, point: LinearisationPoint, width: int) -> tuple[Floats, Floats]:
    """Whitened rows of what is known before."""
    q = len(scene.kept)
    rows, residual = np.zeros((q + 4, width)), np.zeros(q + 4)
    white = np.linalg.inv(np.linalg.cholesky(scene.prior))
    rows[:q, width - 3 - q : width - 3] = white
    residual[:q] = white @ point.coefficients[scene.kept]
    rows[q : q + 3, -3:] = np.diag(1.0 / scene.earth_sigma)
    residual[q : q + 3] = (point.earth - scene.earth_mean) / scene.earth_sigma
    rows[q + 3, 2] = 1.0 / _HEADING
    return rows, residual


def row_sigmas(run: HandheldRun, scene: FitPriors, kind: Ints, extra: Floats) -> Floats:
    """Sigma of every equation in the unit of its residual (SI), shape (m,).

    Parameters
    ----------
    kind : ndarray of int, shape (m,)
        As `equations` gives it.
    extra : ndarray, shape (3,)
        Learned sigmas, as of `LinearisationPoint`.
    """
    white, more = _variances(run, scene, extra)
    return np.asarray(np.sqrt(_spread(run, kind, white + more)))


def _variances(run: HandheldRun, scene: FitPriors, extra: Floats) -> tuple[Floats, Floats]:
    """Variance of the rate and force at each rest and of each turn, (3 k - 1,): by white noise and sway, and beyond."""
    k = len(run.t)
    angle, speed = run.sway.angle**2, run.sway.speed**2
    # What a rest begins with and what it ends with are two draws of its sway, and a turn begins and ends with one.
    white = np.concatenate(
        [
            scene.gyro_white_noise**2 / run.seconds + 2.0 * angle / run.seconds**2,
            scene.accel_white_noise**2 / run.seconds + 2.0 * speed / run.seconds**2,
            scene.gyro_white_noise**2 * run.turn_s + run.gap**2 + angle[:-1] + angle[1:],
        ]
    )
    more = np.concatenate(
        [
            np.full(k, extra[RATE] ** 2),
            np.full(k, extra[FORCE] ** 2),
            (extra[RATE] * run.turn_s) ** 2 + (extra[TURN] * run.path) ** 2,
        ]
    )
    return white, more


def _spread(run: HandheldRun, kind: Ints, by_group: Floats) -> Floats:
    """Values by rest and turn (3 k - 1,) to the rows; priors are whitened already and take 1."""
    k = len(run.t)
    out = np.ones(len(kind))
    at_rest = np.stack([by_group[:k], by_group[:k], by_group[:k], *[by_group[k : 2 * k]] * 3], axis=1)
    out[: 6 * k] = at_rest.ravel()
    out[6 * k : 9 * k - 3] = np.repeat(by_group[2 * k :], 3)
    out[9 * k - 3 : 9 * k - 3 + len(run.whole)] = run.whole_sigma**2
    return out


def _unseen(run: HandheldRun, kind: Ints) -> Bools:
    """Rows of turns that say nothing, shape (m,)."""
    k = len(run.t)
    out = np.zeros(len(kind), dtype=bool)
    out[6 * k : 9 * k - 3] = np.repeat(run.unseen, 3)
    return out


def _solve(rows: Floats, residual: Floats, sigma: Floats) -> tuple[Floats, Floats, Floats]:
    """QR of the whitened rows, and the whitened residual."""
    Q, R = np.linalg.qr(rows / sigma[:, None])
    return np.asarray(Q), np.asarray(R), np.asarray(residual / sigma)


def _learn(
    run: HandheldRun, scene: FitPriors, kind: Ints, extra: Floats, rows: Floats, residual: Floats, step: Floats
) -> Floats:
    """Learn the sigmas beyond white noise from what the step leaves over.

    Each is searched with the redundancies of the present weights; Gauss-Newton repeats it until both stand.
    """
    left = residual + rows @ step
    sigma = row_sigmas(run, scene, kind, extra)
    Q = np.linalg.qr(rows / sigma[:, None])[0]
    seen = ~_unseen(run, kind)
    free = 1.0 - np.sum(Q**2, axis=1)
    out = extra.copy()
    for which in (FORCE, RATE, TURN):
        mine = (kind == which) & seen
        if not mine.any():
            continue

        def excess(
            value: float, which: int = which, mine: Bools = mine, target: float = float(free[mine].sum())
        ) -> float:
            trial = out.copy()
            trial[which] = value
            return float(np.sum((left[mine] / row_sigmas(run, scene, kind, trial)[mine]) ** 2)) - target

        out[which] = _root(excess, float(np.sqrt(np.mean(left[mine] ** 2))))
    return out


def _root(excess: Callable[[float], float], scale: float) -> float:
    """Smallest value >= 0 at which a falling function is no more above zero, by bisection."""
    low, high = 0.0, scale
    if excess(0.0) <= 0.0:
        return 0.0
    while excess(high) > 0.0:
        high *= 2.0
    for _ in range(_BISECTIONS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if excess(middle) > 0.0 else (low, middle)
    return high


def _finish(run: HandheldRun, scene: FitPriors, point: LinearisationPoint, steps: int) -> HandheldSolution:
    """Put the statistics together."""
    rows, residual, kind = equations(run, scene, point)
    sigma = row_sigmas(run, scene, kind, point.extra)
    Q, R, white = _solve(rows, residual, sigma)
    k, q = len(run.t), len(scene.kept)
    inverse = np.linalg.inv(R)
    covariance = inverse @ inverse.T
    measured = (kind >= 0) & ~_unseen(run, kind)
    log = -float(np.sum(np.log(sigma[measured]))) - 0.5 * int(measured.sum()) * np.log(2.0 * np.pi)
    # The determinant of the priors too: without it a coefficient more would count by its unit.
    log += float(np.sum(np.log(np.diag(np.linalg.inv(np.linalg.cholesky(scene.prior))))))
    log -= float(np.sum(np.log(scene.earth_sigma))) + float(np.sum(np.log(np.abs(np.diag(R)))))
    free = 1.0 - np.sum(Q**2, axis=1)
    return HandheldSolution(
        point=point,
        covariance=covariance[3 * k : 3 * k + q, 3 * k : 3 * k + q],
        earth_sigma=np.sqrt(np.diag(covariance)[-3:]),
        chi2=float(np.sum(white[measured] ** 2)),
        dof=float(free[measured].sum()),
        log_likelihood=log - 0.5 * float(white @ white),
        ahead=forces_ahead(Q, white, sigma, k),
        rest_residual=residual[: 6 * k].reshape(k, 6),
        turn_residual=residual[6 * k : 9 * k - 3].reshape(k - 1, 3),
        steps=steps,
    )


def rests_with_residuals(run: HandheldRun, scene: FitPriors, found: HandheldSolution) -> tuple[Rest, ...]:
    """List the rests with what the fit leaves over at each, and on the way to it."""
    k = len(run.t)
    white, more = _variances(run, scene, found.point.extra)
    sigma = np.sqrt(white + more)
    none = np.full((1, 3), np.nan)
    turn = np.vstack([none, np.where(run.unseen[:, None], np.nan, found.turn_residual)])
    turn_sigma = np.concatenate([[np.nan], np.where(run.unseen, np.nan, sigma[2 * k :])])
    start, end = run.t - 0.5 * run.seconds, run.t + 0.5 * run.seconds
    numbers = np.column_stack([start, end, found.rest_residual, turn, sigma[:k], sigma[k : 2 * k], turn_sigma])
    ahead = zip(found.ahead.error.tolist(), found.ahead.sigma.tolist(), strict=True)
    return tuple(
        Rest(a, b, (wx, wy, wz), (fx, fy, fz), (n, e, d), rate, force, way, (ex, ey, ez), (sx, sy, sz))
        for (a, b, wx, wy, wz, fx, fy, fz, n, e, d, rate, force, way), ((ex, ey, ez), (sx, sy, sz)) in zip(
            numbers.tolist(), ahead, strict=True
        )
    )
