"""A test at its last stop, and what the next move would add: the filter's covariance goes on where the test has come.

No sample of the move exists yet; its covariance needs none (`planning.predict`). The IMU turns about one of its own
axes from the attitude in which it stands, as a perfect one would. Noise is white: noise with a memory, which the fit
may have learned, makes each move worth less, and hardly changes which one is worth most.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import cast

import numpy as np

from sdimu_calibration.core.alignment.prepared import TestSetup, first_attitude, reduce, set_up
from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.effects.effect import Effect
from sdimu_calibration.core.effects.motion import Motion
from sdimu_calibration.core.estimation.navigation_fit import NavigationFit
from sdimu_calibration.core.filter.filter_pass import PassState, new_output, run_pass
from sdimu_calibration.core.filter.pass_setup import check_finite, pass_input, pass_settings, start_state
from sdimu_calibration.core.measurement_kind import SKIP
from sdimu_calibration.core.navigation.track import Correction, motion
from sdimu_calibration.core.plan import Plan, Turn
from sdimu_calibration.core.planning.nominal import nominal_recording
from sdimu_calibration.core.recording import TemperatureLog

_BEFORE_S = 2.0
"""Rest before a turn that is simulated (s): whole epochs; it is not measured again."""
_SQUARE = 0.94
"""Cosine (1) from which two axes are along each other: within 20 deg, half of what an oblique stop leans."""
_BY_EPOCH = ("first", "last", "white", "gap_angle", "gap_velocity", "kind", "shift")
"""Fields of `PassInput` with one row an epoch."""
_NEVER_RAD_S2 = 1.0
"""Acceleration of a plan without a turn (rad/s^2): nothing reads it."""


@dataclass(frozen=True)
class SoFar:
    """A test at its last stop."""

    setup: TestSetup
    """Its sensor model has p parameters: those of the fit, then candidates that the data leave open, then what may
    hide."""
    state: PassState
    """Of the filter at the last epoch."""
    seen: Motion
    temperature: TemperatureLog | None
    """It stays as it was last."""
    first: Floats
    """Attitude at the first stop, b to n (dimensionless), shape (3, 3)."""
    own: int
    """How many of the parameters are those of the fit."""

    @property
    def square(self) -> bool:
        """Whether the axes stand as at the first stop, or turned by right angles: every gimbal can then turn."""
        return bool((np.abs(self.first.T @ self.state.C_nb).max(axis=1) > _SQUARE).all())

    @property
    def covariance(self) -> Floats:
        """Covariance of the parameters, shape (p, p), frame of the prior (SI)."""
        return _parameters(self.state)

    @property
    def names(self) -> tuple[str, ...]:
        """Parameters, length p."""
        return self.setup.sensors.names


@dataclass(frozen=True)
class Ahead:
    """What a move would bring, by the length of the stop after it."""

    elapsed_s: Floats
    """From the start of the turn to the end of each epoch of the stop (s), shape (k,)."""
    dwell_s: Floats
    """The part of it that the stop takes (s), shape (k,)."""
    covariance: Floats
    """Of the parameters (SI), shape (k, p, p)."""
    end: SoFar
    """After the longest stop."""


def so_far(fit: NavigationFit, more: Sequence[Effect] = (), room: float = 1.0, hiding: Sequence[Effect] = ()) -> SoFar:
    """Bring the covariance to the end of a recording.

    Parameters
    ----------
    fit : NavigationFit
        Of what was recorded so far.
    more : sequence of Effect
        Candidates that are estimated along.
    room : float
        Prior of the candidates, as a multiple of the size that physics gives them.
    hiding : sequence of Effect
        What may be there unseen: estimated along, too, each with the size that physics gives it.
    """
    model = replace(fit.model, effects=cast("tuple[str, ...]", (*fit.sensors.effects, *more, *hiding)))
    setup = set_up(fit.test.site or fit.setup.site, fit.test.imu, model, fit.setup.epoch_s)
    sensors, before, now = setup.sensors, fit.frame_model.inner.prior, fit.setup.sensors
    # In the frame of the priors, which is not that of the fit: but what was found too narrow is as wide as there.
    had = {n: w for n, w, was in zip(now.names, now.prior, before, strict=True) if w != was}
    hidden = {p.name for effect in hiding for p in effect.parameters}
    own = {*fit.names, *hidden}
    prior = np.array(
        [had.get(n, s if n in own else room * s) for n, s in zip(sensors.names, sensors.prior, strict=True)]
    )
    setup = replace(setup, sensors=replace(sensors, prior=prior))
    prepared, reference = fit.test.data(setup), fit.start.coefficients_of(sensors.names)
    C_nb = fit.start.C_nb.copy()
    # Without an azimuth the alignment of the fit states one as a convention; here it is as open as it was.
    start = first_attitude(prepared.epochs, prepared.phases, setup) if fit.azimuth_free else fit.alignment
    begin = start_state(setup, start, C_nb, reference)
    seen = motion(
        prepared.cycles,
        prepared.rest,
        Correction(sensors, reference),
        C_nb,
        setup.around(prepared.temperature),
        predicted=True,
    )
    data = pass_input(prepared, sensors.regressors(seen), sensors.channel, sensors.parameter)
    output = new_output(len(prepared.epochs), len(prior), False, len(prepared.epochs))
    run_pass(data, pass_settings(setup), begin, output)
    check_finite(begin)
    return SoFar(setup, _at_rest(setup, begin, C_nb), seen, prepared.temperature, fit.start.C_nb, len(fit.names))


def ahead(at: SoFar, turn: Turn | None, dwell_s: float, acceleration_rad_s2: float) -> Ahead:
    """Simulate the covariance of a move. `turn`: None stays where it is; `dwell_s`: longest stop after it."""
    setup, sensors = at.setup, at.setup.sensors
    turns = () if turn is None else (turn,)
    rests = (_BEFORE_S, dwell_s) if turns else (_BEFORE_S + dwell_s,)
    plan = Plan("move", rests, turns, acceleration_rad_s2 if turns else _NEVER_RAD_S2)
    prepared = reduce(nominal_recording(plan, setup.site, C_nt=at.state.C_nb), setup, screened=False)
    epochs = prepared.epochs
    new = epochs.start > _BEFORE_S - 1e-6
    skipped = int(epochs.first[new][0])
    cycles = prepared.cycles[skipped:]
    cycles = replace(cycles, t=cycles.t - _BEFORE_S + at.seen.t[-1])
    C_nb = at.state.C_nb.copy()
    seen = motion(
        cycles,
        prepared.rest[skipped:],
        Correction(sensors, np.zeros(len(sensors.prior))),
        C_nb,
        setup.around(at.temperature),
        predicted=True,
        before=at.seen,
    )
    data = pass_input(replace(prepared, cycles=cycles), sensors.regressors(seen), sensors.channel, sensors.parameter)
    data = data._replace(**{name: getattr(data, name)[new] for name in _BY_EPOCH})
    data = data._replace(first=data.first - skipped, last=data.last - skipped)
    state = PassState(*(v.copy() for v in at.state))
    output = new_output(int(new.sum()), len(sensors.prior), False, 1)
    run_pass(data, pass_settings(setup), state, output)
    check_finite(state)
    moved = sum(t.duration_s for t in turns)
    rows = np.flatnonzero(data.kind != SKIP)
    elapsed = epochs.end[new][rows] - _BEFORE_S
    return Ahead(
        elapsed, elapsed - moved, output.covariance[rows], replace(at, state=_at_rest(setup, state, C_nb), seen=seen)
    )


def _parameters(state: PassState) -> Floats:
    rows = slice(9, 9 + len(state.used))
    return np.asarray(state.P[rows, rows])


def _at_rest(setup: TestSetup, state: PassState, C_nb: Floats) -> PassState:
    """Keep the covariance, at a navigation without errors in the attitude that was reached."""
    position = np.array([setup.site.latitude_rad, 0.0, setup.site.height_m])
    return PassState(np.zeros_like(state.x), state.P, C_nb.copy(), np.zeros(3), position, np.zeros_like(state.used))
