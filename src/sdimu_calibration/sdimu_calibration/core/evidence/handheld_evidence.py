"""The linear model of a hand-held run about its fit: residuals of rests and turns, and how a missing effect would show.

The rows are those of `handheld_fit`, whitened with the sigmas that it learned. Attitudes of the rests and the Earth's
rate are parameters of the model like the coefficients, so that a candidate is scored with all of them estimated again.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sdimu_calibration.core.arrays import Floats, Ints
from sdimu_calibration.core.effects.effect import Effect, Timetable
from sdimu_calibration.core.effects.motion import Motion
from sdimu_calibration.core.evidence.consistency import StopMean
from sdimu_calibration.core.evidence.linear import LinearEvidence, candidate_priors
from sdimu_calibration.core.evidence.testable import WORST_SENSOR
from sdimu_calibration.core.handheld.handheld_data import HandheldRun, Turns, seen_at_rest, turns
from sdimu_calibration.core.handheld.handheld_fit import FitPriors, LinearisationPoint, equations, scatter_of
from sdimu_calibration.core.handheld.run_scatter import PRIOR
from sdimu_calibration.core.specification import ImuSpecification

CHANNELS = ("gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z", "turn_north", "turn_east", "turn_down")
"""What is measured: rate and force at each rest, and the turn that led to it (the heading of north is arbitrary)."""
_DOWN = len(CHANNELS) - 1
"""Index of a channel (1): that of the heading, which a whole turn tells."""
_ANY_ATTITUDE = 1.0
"""Sigma of the prior of an attitude (rad): none, but an attitude whose rows are left out stays finite."""


@dataclass(frozen=True)
class HandheldEvidence(LinearEvidence):
    """Evidence of a hand-held run; the model's parameters are its coefficients, the Earth's rate, attitudes."""

    channel: Ints
    """Into `CHANNELS`, shape (N,)."""
    run: HandheldRun
    rests: Motion
    """What a perfect IMU sees at the rests."""
    gone: Turns
    sigma: Floats
    """Sigma of each row before it was whitened (rad/s, m/s^2, rad for turns), shape (N,)."""

    @property
    def unpredictable(self) -> float:
        """As in `LinearEvidence`; finite here, because a rest is left out with the turn that leads to it.

        Without that turn nothing says where the rest heads, and the last rest has no attitude at all.
        """
        return 1e4

    def signature(self, effects: Sequence[Effect]) -> Floats:
        """Signatures of all parameters of some effects; zero for what could not show, however bad the sensor."""
        if not effects:
            return np.zeros((len(self.e), 0))
        parts = [_signature(self.run, self.rests, self.gone, effect) for effect in effects]
        W = np.hstack(parts) / self.sigma[:, None]
        _, prior = candidate_priors(effects, self.imu)
        # What only shows by the gyros' answer to a force that is wrong in a turn is not seen: no sensor is so bad.
        seen = WORST_SENSOR * np.linalg.norm(W, axis=0) > 1.0 / prior
        return np.where(seen, W, 0.0)


def handheld_evidence(
    run: HandheldRun,
    scene: FitPriors,
    point: LinearisationPoint,
    effects: Sequence[Effect],
    imu: ImuSpecification,
    found: tuple[Effect, ...] = (),
) -> HandheldEvidence:
    """Linearise about a finished fit.

    Parameters
    ----------
    point : LinearisationPoint
        Where the fit ended.
    effects : sequence of Effect
        Each of their parameters becomes a candidate.
    imu : ImuSpecification
        Gives candidates their prior.
    found : tuple of Effect
        As of `LinearEvidence`.
    """
    k, q = len(run.t), len(scene.kept)
    rows, residual = equations(run, scene, point)
    scatter = scatter_of(run, scene)
    sigma, data = scatter.sigmas(point.extra), scatter.kind != PRIOR
    attitude, coefficient, earth = np.split(rows[data], [3 * k, 3 * k + q], axis=1)
    W = -np.hstack([coefficient, earth, attitude]) / sigma[data, None]
    held = np.full(3 * k, _ANY_ATTITUDE**-2)
    held[2] = float(np.sum(rows[-1] ** 2))
    names = tuple(scene.model.names[i] for i in scene.kept)
    begun = HandheldEvidence(
        e=residual[data] / sigma[data],
        W=W,
        stop=np.concatenate([np.repeat(np.arange(k), 6), np.repeat(np.arange(1, k), 3), run.whole + 1]),
        names=(*names, *(f"Earth rate {i}" for i in range(3)), *(f"attitude {i // 3} {i % 3}" for i in range(3 * k))),
        weight=np.concatenate([1.0 / np.diag(scene.prior), scene.earth_sigma**-2, held]),
        shift=np.concatenate([-point.coefficients[scene.kept], scene.earth_mean - point.earth, np.zeros(3 * k)]),
        stated=np.concatenate([np.sqrt(np.diag(scene.prior)), scene.earth_sigma, held**-0.5]),
        candidates=(),
        prior=np.zeros(0),
        imu=imu,
        times=timetable(run),
        coefficients=q - scene.model.serving,
        found=found,
        channel=np.concatenate(
            [np.tile(np.arange(6), k), np.tile(np.arange(6, 9), k - 1), np.full(len(run.whole), _DOWN)]
        ),
        run=run,
        rests=seen_at_rest(run, point.C_nb, point.earth, scene.gravity),
        gone=turns(run, scene.model, point.coefficients, point.C_nb, scene.gravity),
        sigma=sigma[data],
    )
    return begun.with_effects(effects)


def timetable(run: HandheldRun) -> Timetable:
    """When the run rested and turned."""
    start, end = run.t - 0.5 * run.seconds, run.t + 0.5 * run.seconds
    rests = tuple((i, float(a), float(b)) for i, (a, b) in enumerate(zip(start, end, strict=True)))
    ways = tuple((i, float(a), float(b)) for i, (a, b) in enumerate(zip(end[:-1], start[1:], strict=True)))
    return Timetable(float(end[-1]), rests, ways)


def _signature(run: HandheldRun, rests: Motion, gone: Turns, effect: Effect) -> Floats:
    """Change of the measured rates, forces and ways per unit of an effect's parameters, shape (N, parameters)."""
    count = len(effect.parameters)
    values = effect.regressors(rests)
    at_rest = np.zeros((len(run.t), 6, count))
    for column, term in enumerate(effect.terms):
        at_rest[:, term.channel, term.parameter] += values[:, column]
    terms = [(term.channel, term.parameter) for term in effect.terms]
    way = gone.by_parameter(run, effect.regressors(gone.seen), terms, count)
    # A turn's residual is the next attitude less the way of the gyros, the change of which is `way`.
    # Whole turns are of the attitudes alone.
    return np.vstack([at_rest.reshape(-1, count), way.reshape(-1, count), np.zeros((len(run.whole), count))])


def standardised(evidence: HandheldEvidence, chosen: Ints) -> Floats:
    """Residual of every row over the sigma of the residual itself, with some candidates in the model.

    ``r_i / sqrt(1 - w_i C w_i')``, w_i the row of W and C the covariance of the estimate: the statistic of W. Baarda,
    *A testing procedure for use in geodetic networks* (1968).

    Parameters
    ----------
    evidence : HandheldEvidence
        N rows.
    chosen : ndarray of int, shape (k,)
        Columns of the candidates that are estimated with the model.

    Returns
    -------
    ndarray, shape (N,)
        Standard normal when the model is right (dimensionless); NaN where the other rows do not check a row.
    """
    known = np.concatenate([evidence.model, chosen]).astype(np.int64)
    weight = np.concatenate([evidence.weight, np.zeros(len(chosen))])
    estimate, covariance = evidence.information.estimate(known, weight)
    W = evidence.W[:, known]
    free = 1.0 - np.einsum("ij,jk,ik->i", W, covariance, W, optimize=True)
    left = evidence.e - W @ estimate
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(free > _REDUNDANT, left / np.sqrt(free), np.nan)


def places(evidence: HandheldEvidence, chosen: Ints) -> tuple[StopMean, ...]:
    """Say where a model fails: every residual over its own sigma, the largest first.

    Parameters
    ----------
    chosen : ndarray of int, shape (k,)
        Columns of the candidates that are estimated with the model.
    """
    values = standardised(evidence, chosen)
    rows = [
        StopMean(CHANNELS[c], int(s), float(v))
        for c, s, v in zip(evidence.channel, evidence.stop, values, strict=True)
        if np.isfinite(v)
    ]
    return tuple(sorted(rows, key=lambda place: -abs(place.normalised_mean)))


_REDUNDANT = 1e-3
"""Share of a row that the other rows check, from which its residual counts: below it what is left of it is rounding."""
