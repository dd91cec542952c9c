"""The filter for errors of percents: passes about samples that are corrected exactly, until nothing moves.

The passes of `passes` take sensor errors out to first order, see the world along an attitude that the gyros carry
through the whole test, and leave the body frame to the priors. Errors of arcminutes allow all three. Of percents:

- the cycles are corrected exactly at the coefficients of the pass before (`correct_cycles`); the regressors are those
  of corrected samples;
- the body frame is the accelerometers' from the start (`accelerometer_frame`);
- every stop is levelled by its own corrected force before it is measured: without this the attitude of a cheap gyro is
  0.3 deg off after an hour, whose square is more than an accelerometer's noise. A shift of the point of linearisation
  changes nothing that is known, so the state shifts with it.

Each pass is a Gauss-Newton step of the whole test, with the original prior.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np

from sdimu_calibration.core import earth
from sdimu_calibration.core.alignment.alignment import Alignment, levelled
from sdimu_calibration.core.alignment.coarse_alignment import StartPoint, coarse_start
from sdimu_calibration.core.alignment.prepared import PreparedData, TestSetup
from sdimu_calibration.core.alignment.rest_means import Layout, layout
from sdimu_calibration.core.arrays import Floats, Ints
from sdimu_calibration.core.effects.motion import Motion
from sdimu_calibration.core.filter.filter_pass import PassInput, PassOutput, PassState, new_output, run_pass
from sdimu_calibration.core.filter.pass_loop import Ending, FinishedPass, until_nothing_moves
from sdimu_calibration.core.filter.passes import (
    Solution,
    check_finite,
    loosened,
    motion_about,
    pass_input,
    pass_settings,
    start_state,
    with_room,
)
from sdimu_calibration.core.navigation.correct_cycles import CorrectedCycles, correct_cycles, spread
from sdimu_calibration.core.navigation.strapdown import Cycles
from sdimu_calibration.core.navigation.track import integrate
from sdimu_calibration.core.progress import Progress
from sdimu_calibration.core.rotation import orthonormal, rotation_vector

MOST_PASSES = 30
"""Number of passes at most: where the estimate still moves then, it does not converge."""
_NEAR = 1.0
"""Movement of a coefficient (sigma) from which Zv and Zp are taken in: the azimuth has found its place."""
_ENDING = Ending(MOST_PASSES, settled=_NEAR, most_loose=MOST_PASSES, least=1, near=0.0)
"""Passes about corrected samples: each contracts to the square of what was wrong."""
_FIRM = 0.05
"""Later sigmas of Zv and Zp at least, as a share of what white noise leaves in a motion of `_MOTION_S`: no less can be
told from zero, and a covariance that falls by more than ten digits loses its symmetry."""
_MOTION_S = 60.0
"""Length of a usual turn (s): at 2 deg/s one of 90 deg takes 45 s, one of 180 deg 90 s."""
_PIECE = 3
"""Number of epochs of a stop between two shifts of the attitude to that of the stop: in more, a cheap gyro drifts so
far that azimuth looks observable."""

_OF_EPOCHS = ("first", "last", "white", "gap_angle", "gap_velocity", "kind", "restart")
"""Fields of `PassInput` with one row an epoch."""


@dataclass(frozen=True)
class SecondOrderPass(FinishedPass):
    """A finished pass about exactly corrected samples, in the accelerometers' frame.

    The coefficients of its states are deviations from `reference`; its output keeps the covariances of `rows`.
    """

    reference: Floats
    """Coefficients at which the samples were corrected (SI), shape (q,)."""
    rows: Ints
    """First epoch of each piece of the pass (`run_stops`), shape (j,)."""
    C_stop: Floats
    """Attitude about which each stop was linearised, b to n, shape (k, 3, 3)."""
    where: Layout

    @property
    def about(self) -> Floats:
        """Coefficients at which the samples were corrected (SI), shape (q,)."""
        return self.reference


def solve_second_order(
    setup: TestSetup, prepared: PreparedData, start: Alignment, begin: StartPoint | None, progress: Progress
) -> Solution[SecondOrderPass]:
    """Repeat passes until the coefficients stand still; where they contradict their priors, with wider ones.

    Parameters
    ----------
    setup : TestSetup
        With the inner model of an `accelerometer_frame.AccelerometerFrameModel`.
    begin : StartPoint or None
        Attitude and coefficients of the first linearisation; None finds them from all stops.
    """

    def passes(setup: TestSetup, begin: StartPoint, loose: bool) -> tuple[SecondOrderPass, int, bool]:
        wide, firm = loosened(setup), firm_setup(setup)

        def run(at: StartPoint, _: SecondOrderPass | None, loose: bool) -> SecondOrderPass:
            return second_order_pass(prepared, wide if loose else firm, start, at.C_nb, at.coefficients)

        return until_nothing_moves(run, begin, loose, _ENDING, progress)

    last, count, converged = passes(setup, begin or coarse_start(prepared, setup, start), begin is None)
    found = Solution(setup, prepared, start, last, last, count, converged)
    done = with_room(found, lambda setup, last: passes(setup, StartPoint(last.smoothed_start, last.estimate), False))
    return replace(done, first=done.last)


def firm_setup(setup: TestSetup) -> TestSetup:
    """Make the setup of the later passes: Zv and Zp no tighter than can be told from zero."""
    model = setup.model
    velocity = _FIRM * setup.imu.accel_white_noise * float(np.sqrt(_MOTION_S))
    position = velocity * _MOTION_S / float(np.sqrt(3.0))
    return replace(
        setup,
        model=replace(
            model,
            velocity_sigma=max(model.velocity_sigma, velocity),
            position_sigma=max(model.position_sigma, position),
        ),
    )


@dataclass(frozen=True)
class Linearisation:
    """Samples corrected at a set of coefficients, and what they become when the coefficients change a little."""

    reference: Floats
    """Coefficients (SI) at which the samples were corrected, shape (q,)."""
    where: Layout
    C_stop: Floats
    """Attitude of every stop (b to n), levelled by its own corrected force, shape (k, 3, 3)."""
    seen: Motion
    """Motion along these attitudes, n cycles."""
    weight: Floats
    """Change of corrected rate and force per change of the measured ones, shape (n, 6, 6)."""
    data: PassInput


def linearise(prepared: PreparedData, setup: TestSetup, C_nb: Floats, reference: Floats) -> Linearisation:
    """Correct the samples exactly and linearise there.

    Parameters
    ----------
    C_nb : ndarray, shape (3, 3)
        Initial attitude, b to n.
    reference : ndarray, shape (q,)
        Coefficients whose errors are taken out of the samples (SI).
    """
    sensors, where = setup.sensors, layout(prepared)
    clean = correct_cycles(prepared.cycles, motion_about(prepared, setup, C_nb, reference), sensors, reference)
    C_stop, track = _stops(clean.cycles, where, C_nb, setup.site.latitude_rad)
    seen = _predicted(clean, prepared, where, track, setup)
    values, channel, parameter = spread(sensors.regressors(seen), sensors.channel, sensors.parameter, clean.weight)
    data = pass_input(replace(prepared, cycles=clean.cycles), values, channel, parameter)
    return Linearisation(reference, where, C_stop, seen, clean.weight, data)


def second_order_pass(
    prepared: PreparedData, setup: TestSetup, start: Alignment, C_nb: Floats, reference: Floats
) -> SecondOrderPass:
    """Run one pass about exactly corrected samples.

    Parameters
    ----------
    start : Alignment
        Mean and sigma of the initial attitude.
    C_nb : ndarray, shape (3, 3)
        Initial attitude about which the pass is linearised, b to n.
    reference : ndarray, shape (q,)
        Coefficients at which the samples are corrected (SI).
    """
    at = linearise(prepared, setup, C_nb, reference)
    begin = start_state(setup, start, at.C_stop[0], reference)._replace(used=np.zeros(len(reference)))
    return run_linearised(at, setup, begin, prepared)


def run_linearised(
    at: Linearisation, setup: TestSetup, begin: PassState, prepared: PreparedData, keep: bool = False
) -> SecondOrderPass:
    """Run the filter about a linearisation from the state `begin`; `keep` the matrices of every epoch."""
    state, output, rows = run_stops(at.data, setup, begin, prepared, at.where, at.C_stop, keep)
    check_finite(state)
    return SecondOrderPass(at.C_stop[0], begin, state, output, at.data, at.reference, rows, at.C_stop, at.where)


def _stops(cycles: Cycles, where: Layout, C_nb: Floats, latitude: float) -> tuple[Floats, Floats]:
    """Attitude of every stop (k, 3, 3), levelled, and of every cycle (n, 3, 3), led on by the gyros from each stop."""
    first = np.append(where.stop_first, len(cycles))
    C = C_nb.copy()
    stops, track = [], [integrate(C, cycles[: int(first[0])], latitude)]
    for k in range(len(where.stop_first)):
        rest = slice(int(where.stop_first[k]), int(where.stop_last[k]))
        C = levelled(C, cycles.upsilon[rest].sum(axis=0))
        stops.append(C.copy())
        track.append(np.repeat(C[None], rest.stop - rest.start, axis=0))
        track.append(integrate(C, cycles[rest.stop : int(first[k + 1])], latitude))
    return np.array(stops), np.concatenate(track)


def _predicted(
    clean: CorrectedCycles, prepared: PreparedData, where: Layout, track: Floats, setup: TestSetup
) -> Motion:
    """Motion along reference attitudes (n, 3, 3): without noise at the stops, by the corrected samples elsewhere."""
    w_earth = np.einsum("kij,i->kj", track, earth.earth_rate(setup.site.latitude_rad))
    still = np.zeros(len(track), dtype=bool)
    for a, b in zip(where.stop_first, where.stop_last, strict=True):
        still[a:b] = True
    w = np.where(still[:, None], w_earth, clean.seen.w)
    f = np.where(still[:, None], -setup.gravity * track[:, 2, :], clean.seen.f)
    w_table = np.where(prepared.rest[:, None], 0.0, clean.seen.w - w_earth)
    return replace(clean.seen, C_nb=track, w=w, f=f, w_table=w_table)


def run_stops(
    data: PassInput,
    setup: TestSetup,
    begin: PassState,
    prepared: PreparedData,
    where: Layout,
    C_stop: Floats,
    keep: bool = False,
) -> tuple[PassState, PassOutput, Ints]:
    """Run a pass piece by piece, with each stop linearised at its own attitude.

    A piece is a motion, or at most `_PIECE` epochs of a stop.

    Parameters
    ----------
    begin : PassState
        At the first sample; it is not changed.
    where : Layout
        k stops.
    C_stop : ndarray, shape (k, 3, 3)
        Attitude about which each stop is linearised, b to n (dimensionless).
    keep : bool
        Keep the matrices of every epoch in the output.

    Returns
    -------
    state : PassState
        After the last epoch.
    output : PassOutput
        Of all epochs.
    rows : ndarray of int, shape (j,)
        First epoch of each piece: those whose covariance was kept.
    """
    state = PassState(*(v.copy() for v in begin))
    settings = pass_settings(setup, closed_loop=False)
    edges, stop = _pieces(prepared, where)
    parts: list[PassOutput] = []
    rows: list[Ints] = []
    for (a, b), k in zip(pairwise(edges), stop, strict=True):
        if k >= 0:
            _shift(state, C_stop[k])
        part = data._replace(**{name: getattr(data, name)[a:b] for name in _OF_EPOCHS})
        out = new_output(b - a, len(state.used), keep, b - a, navigation_only=True)
        run_pass(part, settings, state, out)
        parts.append(out)
        rows.append(np.array([a]))
    return state, PassOutput(*(_joined(parts, name) for name in PassOutput._fields)), np.concatenate(rows)


def _joined(parts: list[PassOutput], name: str) -> Any:
    return 1 if name == "stride" else np.concatenate([getattr(part, name) for part in parts])


def _pieces(prepared: PreparedData, where: Layout) -> tuple[list[int], list[int]]:
    """Cut the epochs at every stop and within stops; edges (m + 1), and the stop of each piece, -1 in motion.

    Between two shifts the attitude of a cheap gyro drifts, and the horizontal force it then sees makes azimuth look
    observable: three seconds keep that below what Earth rate tells.
    """
    epochs = prepared.epochs
    first, last = (np.searchsorted(epochs.first, c) for c in (where.stop_first, where.stop_last))
    edges, stop, at = [0], [], 0
    for k, (a, b) in enumerate(zip(first.tolist(), last.tolist(), strict=True)):
        for cut, owner in [(a, -1), *((min(c + _PIECE, b), k) for c in range(a, b, _PIECE))]:
            if cut > at:
                edges.append(cut)
                stop.append(owner)
                at = cut
    if at < len(epochs):
        edges.append(len(epochs))
        stop.append(-1)
    return edges, stop


def _shift(state: PassState, C_nb: Floats) -> None:
    """Go on from the attitude `C_nb` (3, 3), in place: the attitude error is counted from there.

    No half product of shift and error is added as after a reset of a closed loop (`filter_pass`): the rows of Zf
    know no second order, so an error in them is the tilt as it is seen, whatever the azimuth, and tilts so seen add.
    With the half product every shift says something about azimuth that no sample said.
    """
    state.x[6:9] -= rotation_vector(C_nb @ state.C_nb.T)
    state.C_nb[:, :] = orthonormal(np.ascontiguousarray(C_nb))
