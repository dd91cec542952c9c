"""A pass over a recording, about samples that are corrected exactly.

- The cycles are corrected exactly at the coefficients of the pass before (`correct_cycles`); the regressors are those
  of corrected samples.
- Every stop is levelled by its own corrected force before it is measured: without this the attitude of a cheap gyro is
  0.3 deg off after an hour, whose square is more than an accelerometer's noise. A shift of the point of linearisation
  changes nothing that is known, so the state shifts with it.

Coefficients that fade are corrected at zero: nothing that was known of them at the end of a pass holds at its begin.
They are states like the others.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from sdimu_calibration.core import earth
from sdimu_calibration.core.alignment.alignment import Alignment, levelled
from sdimu_calibration.core.alignment.prepared import PreparedData, TestSetup
from sdimu_calibration.core.alignment.rest_means import Layout, layout
from sdimu_calibration.core.arrays import Floats, Ints
from sdimu_calibration.core.effects.motion import Motion
from sdimu_calibration.core.filter.filter_pass import PassInput, PassState, new_output, run_pass
from sdimu_calibration.core.filter.impossible_prior import impossible_prior, possible
from sdimu_calibration.core.filter.pass_loop import Pass
from sdimu_calibration.core.filter.pass_setup import check_finite, pass_input, pass_settings, start_state
from sdimu_calibration.core.navigation.correct_cycles import CorrectedCycles, correct_cycles, spread
from sdimu_calibration.core.navigation.strapdown import Cycles
from sdimu_calibration.core.navigation.track import Correction, integrate, motion
from sdimu_calibration.core.recording import DataError, DivergedError

SNAPSHOT_EPOCHS = 5
"""Number of epochs from one kept covariance of the coefficients to the next: it changes slowly, and is large."""
PIECE = 3
"""Number of epochs (1 s, up to 10 s in long rests) of a stop between two shifts of the attitude to that of the stop: in
more, a cheap gyro drifts so far that azimuth looks observable."""


def motion_about(prepared: PreparedData, setup: TestSetup, C_nb: Floats, reference: Floats) -> Motion:
    """Motion that the effects of a test see, as of `track.motion`.

    Parameters
    ----------
    C_nb : ndarray, shape (3, 3)
        Initial attitude, b to n (dimensionless).
    reference : ndarray, shape (p,)
        Coefficients whose errors are taken out of the samples (SI).
    """
    # One round is near enough: the exact correction goes on from there.
    correction, around = Correction(setup.sensors, reference, rounds=1), setup.around(prepared.temperature)
    return motion(prepared.cycles, prepared.rest, correction, C_nb.copy(), around, predicted=False)


@dataclass(frozen=True)
class Linearisation:
    """Samples corrected at a set of coefficients, and what they become when the coefficients change a little."""

    reference: Floats
    """Coefficients (SI) at which the samples were corrected, shape (q,)."""
    C_start: Floats
    """Attitude at the first sample (b to n), shape (3, 3)."""
    seen: Motion
    """Motion along these attitudes, n cycles."""
    weight: Floats
    """Change of corrected rate and force per change of the measured ones, shape (n, 6, 6)."""
    data: PassInput
    """With the attitude of every stop, levelled by its own corrected force."""


def linearise(prepared: PreparedData, setup: TestSetup, C_nb: Floats, reference: Floats) -> Linearisation:
    """Correct the samples exactly and linearise there.

    Parameters
    ----------
    C_nb : ndarray, shape (3, 3)
        Initial attitude, b to n.
    reference : ndarray, shape (p,)
        Coefficients whose errors are taken out of the samples (SI); those that fade are taken at zero.
    """
    sensors, where = setup.sensors, layout(prepared)
    reference = reference * (sensors.decay_rate == 0.0)
    clean = correct_cycles(prepared.cycles, motion_about(prepared, setup, C_nb, reference), sensors, reference)
    C_stop, track = _stops(clean.cycles, where, C_nb, setup.site.latitude_rad)
    seen = _predicted(clean, prepared, where, track, setup)
    measured = sensors.regressors(seen)
    if not np.isfinite(measured).all():
        raise DataError("a sensor effect of the model is not finite on this recording: check its expression")
    values, channel, parameter = spread(measured, sensors.channel, sensors.parameter, clean.weight)
    data = pass_input(replace(prepared, cycles=clean.cycles), values, channel, parameter)
    data = data._replace(shift=_shifts(prepared, where), C_stop=C_stop)
    resting = bool(prepared.rest[: where.stop_first[0]].all())
    return Linearisation(reference, C_stop[0] if resting else C_nb, seen, clean.weight, data)


def one_pass(prepared: PreparedData, setup: TestSetup, start: Alignment, C_nb: Floats, reference: Floats) -> Pass:
    """Run one pass about exactly corrected samples.

    Parameters
    ----------
    start : Alignment
        Mean and sigma of the initial attitude.
    C_nb : ndarray, shape (3, 3)
        Initial attitude about which the pass is linearised, b to n.
    reference : ndarray, shape (p,)
        Coefficients at which the samples are corrected (SI).
    """
    at = linearise(prepared, setup, C_nb, reference)
    return run_linearised(at, setup, begun(at, setup, start))


def begun(at: Linearisation, setup: TestSetup, start: Alignment) -> PassState:
    """State at the first sample of a pass; its samples are corrected already."""
    return start_state(setup, start, at.C_start, at.reference)._replace(used=np.zeros(len(at.reference)))


def run_linearised(at: Linearisation, setup: TestSetup, begin: PassState, keep: bool = False) -> Pass:
    """Run the filter about a linearisation from the state `begin`.

    Parameters
    ----------
    keep : bool
        Keep the matrices of the navigation errors of every epoch in the output.
    """
    state = PassState(*(v.copy() for v in begin))
    output = new_output(len(at.data.first), len(begin.used), keep, SNAPSHOT_EPOCHS, navigation_only=keep)
    run_pass(at.data, pass_settings(setup), state, output)
    try:
        check_finite(state)
    except DivergedError as error:
        # About a motion that no table makes every prior allows too much: what a pass before made of it is no cause.
        sensors = setup.sensors
        told = impossible_prior(sensors, sensors.regressors(at.seen), setup.imu.place) if possible(at.seen) else ""
        if told:
            raise DataError(told) from error
        raise
    return Pass(at.reference, at.C_start, begin, state, output, at.data)


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


def _shifts(prepared: PreparedData, where: Layout) -> Ints:
    """Stop to whose attitude the navigation shifts before each epoch, -1 for none, shape (e,).

    Between two shifts the attitude of a cheap gyro drifts, and the horizontal force it then sees makes azimuth look
    observable: three seconds keep that below what Earth rate tells.
    """
    first, last = (np.searchsorted(prepared.epochs.first, c) for c in (where.stop_first, where.stop_last))
    out = np.full(len(prepared.epochs), -1)
    for k, (a, b) in enumerate(zip(first.tolist(), last.tolist(), strict=True)):
        out[a:b:PIECE] = k
    return out
