"""Passes over a recording: from samples to the converged estimate.

Pass 1 is closed loop. Each later pass is linearised about the coefficients and the smoothed initial attitude of the
pass before, keeps them fixed, and estimates the deviation from them with the original prior: Gauss-Newton on the whole
test, in the loop of `pass_loop`, as are passes about exactly corrected cycles (`second_order_passes`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Generic

import numpy as np

from sdimu_calibration.core import earth
from sdimu_calibration.core.alignment.alignment import Alignment
from sdimu_calibration.core.alignment.coarse_alignment import StartPoint, coarse_start
from sdimu_calibration.core.alignment.prepared import PreparedData, TestSetup, first_attitude
from sdimu_calibration.core.arrays import Bools, Floats, Ints
from sdimu_calibration.core.data.phases import restarts
from sdimu_calibration.core.effects.imu_model import ImuModel
from sdimu_calibration.core.effects.motion import Motion
from sdimu_calibration.core.filter.filter_pass import (
    COPY,
    NAV,
    PassInput,
    PassSettings,
    PassState,
    new_output,
    run_pass,
)
from sdimu_calibration.core.filter.impossible_prior import impossible_prior, possible
from sdimu_calibration.core.filter.means_at_stops import means_at_stops
from sdimu_calibration.core.filter.pass_loop import AnyPass, Ending, FinishedPass, until_nothing_moves
from sdimu_calibration.core.measurement_kind import SKIP
from sdimu_calibration.core.navigation.track import Correction, motion
from sdimu_calibration.core.progress import Progress
from sdimu_calibration.core.recording import DataError, DivergedError
from sdimu_calibration.core.rotation import rotation_vector
from sdimu_calibration.core.wording import Option

MOST_PASSES = 16
"""Number of passes at most: where the estimate still moves then, `_NEAR` tells slow from lost."""
_LOOSE_VELOCITY = 1.0
"""Sigma of Zv (m/s) while the passes find their place: too wide to say anything."""
_LOOSE_POSITION = 100.0
"""Sigma of Zp (m) while the passes find their place: too wide to say anything."""
_FITS = 1.1
"""NIS per degree of freedom (1) up to which a first pass fits: above it linearisation may be the trouble."""
_NEAR = 0.2
"""Movement of a coefficient (sigma) up to which an estimate that ran out of passes still is one: passes that contract
slowly have no more than a fraction of a sigma to go."""
_SETTLED = 0.1
"""Movement of a coefficient (sigma) at which position and velocity are taken in again: the azimuth is in its place."""
SNAPSHOT_EPOCHS = 5
"""Number of epochs from one kept covariance of the coefficients to the next: it changes slowly, and is large."""


@dataclass(frozen=True)
class Pass(FinishedPass):
    """A pass about samples corrected to first order, in the frame of the prior."""

    @property
    def about(self) -> Floats:
        """Coefficients that are in use, shape (p,)."""
        return self.state.used

    def without_regressors(self) -> Pass:
        """Return the pass without its regressors: of a long recording they are most of what it holds."""
        return replace(self, data=self.data._replace(values=np.empty((0, self.data.values.shape[1]))))


def pass_settings(setup: TestSetup, closed_loop: bool) -> PassSettings:
    """Constants of a pass."""
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
        closed_loop=closed_loop,
        shared_noise=model.shared_noise,
        shaken=setup.shaken,
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
    )


def motion_about(
    prepared: PreparedData,
    setup: TestSetup,
    C_nb: Floats,
    reference: Floats,
    predicted: bool = False,
    near: Floats | None = None,
    causal: bool = False,
) -> Motion:
    """Motion that the effects of a test see, as of `track.motion`.

    Parameters
    ----------
    C_nb : ndarray, shape (3, 3)
        Initial attitude, b to n (dimensionless).
    reference : ndarray, shape (p,)
        Coefficients whose errors are taken out of the samples (SI).
    near : ndarray, shape (n, m), optional
        Regressors about nearly the same coefficients.
    """
    return motion(
        prepared.cycles,
        prepared.rest,
        Correction(setup.sensors, reference, near),
        C_nb.copy(),
        setup.around(prepared.temperature),
        predicted=predicted,
        causal=causal,
    )


def one_pass(
    prepared: PreparedData,
    setup: TestSetup,
    start: Alignment,
    C_nb: Floats,
    reference: Floats,
    closed_loop: bool,
    keep: bool = False,
    near: Floats | None = None,
) -> Pass:
    """Run one pass.

    Parameters
    ----------
    start : Alignment
        Mean and sigma of the initial attitude.
    C_nb : ndarray, shape (3, 3)
        Initial attitude about which the pass is linearised, b to n.
    reference : ndarray, shape (p,)
        Coefficients about which it is linearised (SI).
    closed_loop : bool
        Feed attitude and coefficients back after each measurement; the motion that the effects see is then taken from
        compensated samples, and not predicted from the trajectory.
    keep : bool
        Keep the matrices of every epoch in the output.
    near : ndarray, shape (n, m), optional
        Regressors of a pass about nearly the same coefficients.
    """
    sensors = setup.sensors
    motion = motion_about(prepared, setup, C_nb, reference, not closed_loop, near, closed_loop)
    values = sensors.regressors(motion)
    if not np.isfinite(values).all():
        raise DataError("a sensor effect of the model is not finite on this recording: check its expression")
    data = pass_input(prepared, values, sensors.channel, sensors.parameter)
    begin = start_state(setup, start, C_nb, reference)
    state = PassState(*(v.copy() for v in begin))
    output = new_output(len(prepared.epochs), len(sensors.prior), keep, SNAPSHOT_EPOCHS)
    run_pass(data, pass_settings(setup, closed_loop), state, output)
    try:
        check_finite(state)
    except DivergedError as error:
        # About a motion that no table makes every prior allows too much: what a pass before made of it is no cause.
        told = impossible_prior(sensors, values, setup.imu.place) if possible(motion) else ""
        if told:
            raise DataError(told) from error
        raise
    return Pass(C_nb, begin, state, output, data)


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


_ENDING = Ending(MOST_PASSES - 1, settled=_SETTLED, most_loose=MOST_PASSES // 2 - 1, least=2, near=_NEAR)
"""Passes after the first: where Earth rate says little of the azimuth they contract by a third each, and near enough is
told from lost."""


def refine(
    prepared: PreparedData, setup: TestSetup, start: Alignment, first: Pass, progress: Progress
) -> tuple[Pass, int, bool]:
    """Repeat open-loop passes after `first` by `until_nothing_moves`.

    Position and velocity are known so well that the second order of a large error of the initial azimuth contradicts
    them, and holding on to them pins the azimuth where it is. A first pass that did not fit is therefore followed
    by passes that let them go, until the rest has found its place.
    """
    free, constant = loosened(setup), setup.sensors.decay_rate == 0.0

    def run(at: StartPoint, before: Pass | None, loose: bool) -> Pass:
        near, reference = (before or first).data.values, at.coefficients * constant
        return one_pass(prepared, free if loose else setup, start, at.C_nb, reference, closed_loop=False, near=near)

    return until_nothing_moves(run, StartPoint(first.smoothed_start, first.estimate), misfits(first), _ENDING, progress)


def loosened(setup: TestSetup) -> TestSetup:
    """Let position and velocity go."""
    return replace(setup, model=replace(setup.model, velocity_sigma=_LOOSE_VELOCITY, position_sigma=_LOOSE_POSITION))


def misfits(done: Pass) -> bool:
    """Whether the innovations are so large that linearisation may be the trouble."""
    nis = done.output.nis
    return bool(np.nansum(nis) > _FITS * 3 * np.isfinite(nis).sum())


def coarse_pass(prepared: PreparedData, setup: TestSetup, start: Alignment) -> Pass:
    """Run a closed-loop pass from the coarse start: where `refine` begins when one dwell may have misled the first."""
    coarse = coarse_start(prepared, setup, start)
    return one_pass(prepared, setup, start, coarse.C_nb, coarse.coefficients, closed_loop=True)


_ATTITUDE_PASSES = 3
"""Number of passes that let position and velocity go: each leaves the square of the attitude's error: of a degree
nothing."""


def attitude_about(
    prepared: PreparedData, setup: TestSetup, start: Alignment, C_nb: Floats, reference: Floats
) -> Floats:
    """Find the initial attitude where the coefficients are given.

    The coarse azimuth of uncalibrated gyros may be wrong by a degree; position and velocity would pin a pass near
    it, as in `passes.refine`.

    Parameters
    ----------
    C_nb : ndarray, shape (3, 3)
        Initial attitude to begin with, b to n (dimensionless).
    reference : ndarray, shape (p,)
        Coefficients (SI).

    Returns
    -------
    ndarray, shape (3, 3)
        `C_nb` itself where it fits.
    """
    if not misfits(one_pass(prepared, setup, start, C_nb, reference, closed_loop=False)):
        return C_nb
    for _ in range(_ATTITUDE_PASSES):
        C_nb = one_pass(prepared, loosened(setup), start, C_nb, reference, closed_loop=False).smoothed_start
    return C_nb


@dataclass(frozen=True)
class Solution(Generic[AnyPass]):
    """A converged calibration with everything that led to it."""

    setup: TestSetup
    prepared: PreparedData
    alignment: Alignment
    first: AnyPass
    last: AnyPass
    """`first`, `last`: the pass whose estimate on the way is shown, and the converged one: of the filter the
    closed-loop pass (its output: no regressors are kept), of second-order passes the last one, too."""
    passes: int
    """How many there were."""
    converged: bool
    """The coefficients stood still at the end."""


def widen_contradicted_priors(
    sensors: ImuModel, estimate: Floats, covariance: Floats, scatter: float = 1.0
) -> ImuModel:
    """Widen the prior of an effect that is far beyond it and that it holds back; the same object when none is.

    A prior is a statement about the class of the sensor; one that the model states of a coefficient is taken at its
    word. Where the data contradict a prior, the estimate lies between
    the two and is wrong, and the rest of the effect goes into the other coefficients. Misalignments keep their prior:
    nothing else holds their common part, the frame of the prior.

    Parameters
    ----------
    sensors : ImuModel
        With p parameters.
    estimate, covariance : ndarray, shapes (p,) and (p, p)
        SI.
    scatter : float
        Scatter of the means of the innovations at stops, in that of white noise (1).
    """
    gauge = np.array([e.gauge for e in sensors.effects for _ in e.parameters])
    held, data = held_back(sensors.weight, estimate, covariance, scatter)
    held &= ~gauge & ~sensors.restated
    if not held.any():
        return sensors
    return replace(sensors, prior=np.where(held, ROOM * np.abs(data), sensors.prior))


def held_back(weight: Floats, estimate: Floats, covariance: Floats, scatter: float = 1.0) -> tuple[Bools, Floats]:
    """Tell the coefficients whose data are far beyond their prior and that it holds back, and what the data say.

    The prior p and what the data say by themselves d differ by ``d / sqrt(sigma_d^2 + sigma_p^2)`` sigmas, which of an
    estimate x of variance v is ``x / (sigma_p sqrt(s))``, s = 1 - v / sigma_p^2 the share of the data: where they know
    less than the prior, the estimate stays near it however far they are. Below a share of `_LEAST_SHARE` its square
    over s stands in the place of s: the less the data know, the more it takes, up to the estimate itself.

    Parameters
    ----------
    weight : ndarray, shape (p,)
        Prior information (1/SI^2).
    estimate, covariance : ndarray, shapes (p,) and (p, p)
        SI.
    scatter : float
        Scatter of the data over that which the covariance knows (1): in noise with a memory, which the passes do not
        know, data of a weak coefficient are further off than white noise says.

    Returns
    -------
    held : ndarray of bool, shape (p,)
    data : ndarray, shape (p,)
        Each coefficient without its own prior (SI), the prior left in by as much as the data hardly know it.
    """
    size, variance = np.abs(estimate), np.diag(covariance)
    share = np.maximum(1.0 - weight * variance, _LEAST_SHARE**2)
    of_data = np.where(share > _LEAST_SHARE, share, _LEAST_SHARE**2 / share)
    # An estimate that is far beyond its prior is so in any noise.
    beyond = size * np.sqrt(weight) > _BEYOND * np.minimum(scatter * np.sqrt(of_data), 1.0)
    return beyond & (size * np.sqrt(variance) * weight > _PULL), estimate / of_data


_BEYOND = 3.0
"""Distance of the data from the prior (sigma of both) from which they contradict it: chance ends there."""
_LEAST_SHARE = 0.05
"""Share of the information on a coefficient (1) from which data speak by themselves: with less they know it to four
sigmas of its prior, so far off that a fit of one rest is not linear any more, and noise with a memory widens a prior a
thousandfold."""
_PULL = 0.1
"""Shift of an estimate by its prior (sigma of the estimate) from which the passes are repeated: less is not seen."""
ROOM = 10.0
"""New sigma of a contradicted prior, as a multiple of the estimate: so wide that the prior holds nothing back."""
MOST_WIDENINGS = 3
"""Number of times at most that priors are widened and the passes repeated: a widened prior holds nothing back, so a
next time is for coefficients that the first ones had hidden."""


def solve(setup: TestSetup, prepared: PreparedData, begin: StartPoint | None, progress: Progress) -> Solution[Pass]:
    """Align, run the closed loop, refine.

    Parameters
    ----------
    begin : StartPoint or None
        Where a fit of nearly the same model ended: the passes go on from there, without a closed-loop pass. None
        begins with the first dwell.
    """
    start = first_attitude(prepared.epochs, prepared.phases, setup)
    progress("passes", 0.2)
    point = begin or StartPoint(start.C_nb, np.zeros(len(setup.sensors.prior)))
    first = one_pass(prepared, setup, start, point.C_nb, point.coefficients, closed_loop=begin is None)
    try:
        last, passes, converged = refine(prepared, setup, start, first, progress)
    except DataError:
        converged = False
    if not converged:
        # The first dwell misled the first pass (an azimuth that may be anything): all stops together know better.
        first = (
            first
            if begin is None
            else one_pass(prepared, setup, start, start.C_nb, np.zeros(len(setup.sensors.prior)), closed_loop=True)
        )
        begun = coarse_pass(prepared, setup, start)
        last, passes, converged = refine(prepared, setup, start, begun, progress)
    found = Solution(setup, prepared, start, first.without_regressors(), last, 1 + passes, converged)
    return with_room(found, lambda wider, last: refine(prepared, wider, start, last, progress))


def with_room(
    found: Solution[AnyPass], again: Callable[[TestSetup, AnyPass], tuple[AnyPass, int, bool]]
) -> Solution[AnyPass]:
    """Repeat passes that converged with wider priors where the data contradict them.

    Parameters
    ----------
    again : callable
        Goes on from a pass in another setup: the last pass, the number of passes made, whether they converged.
    """
    for _ in range(MOST_WIDENINGS):
        # An estimate that does not stand still says nothing against a prior.
        if not found.converged:
            break
        setup, last = found.setup, found.last
        means = means_at_stops(last.output.innovation / last.output.innovation_sigma, found.prepared)[1]
        scatter = max(1.0, float(np.sqrt(np.nanmean(means**2))))
        wider = widen_contradicted_priors(setup.sensors, last.estimate, last.covariance, scatter)
        if wider is setup.sensors:
            break
        setup = replace(setup, sensors=wider)
        last, more, converged = again(setup, last)
        found = replace(found, setup=setup, last=last, passes=found.passes + more, converged=converged)
    return found
