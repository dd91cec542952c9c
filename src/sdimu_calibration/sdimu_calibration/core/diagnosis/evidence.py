"""Everything a diagnosis reads: whitened innovations and the signature of every known and suspected parameter."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from sdimu_calibration.core.alignment.prepared import PreparedData, TestSetup
from sdimu_calibration.core.arrays import Floats, Ints
from sdimu_calibration.core.diagnosis.candidates import split
from sdimu_calibration.core.diagnosis.linear import LinearEvidence
from sdimu_calibration.core.diagnosis.signatures import measured_rows, signatures
from sdimu_calibration.core.effects.effect import Effect, Timetable
from sdimu_calibration.core.effects.motion import Motion
from sdimu_calibration.core.filter.filter_pass import NAV, PassOutput, PassState, new_output, run_pass
from sdimu_calibration.core.filter.passes import Pass, pass_settings
from sdimu_calibration.core.navigation.track import motion


@dataclass(frozen=True)
class Evidence(LinearEvidence):
    """Innovations of the navigation filter about a converged calibration; every parameter of the model a coefficient.

    Attributes
    ----------
    epoch, channel : ndarray of int, shape (N,)
        Of each row; channels 0-11 are position, velocity, rate, force, three each.
    output : PassOutput
        Of the navigation filter.
    seen : Motion
    times : Timetable
    prepared : PreparedData
    latitude : float
        Of the site (rad).
    """

    epoch: Ints
    channel: Ints
    output: PassOutput
    seen: Motion
    times: Timetable
    prepared: PreparedData
    latitude: float

    def signature(self, effects: Sequence[Effect]) -> Floats:
        """Columns of all parameters of `effects`, shape (N, parameters)."""
        return columns(self.prepared, self.output, self.seen, self.latitude, effects)


def timetable(prepared: PreparedData) -> Timetable:
    """When the recording stood and turned, from the phases of the epochs."""
    phases, epochs = prepared.phases, prepared.epochs
    edges = np.flatnonzero(np.diff(np.concatenate([[0], phases.dwell.astype(int), [0]])))
    dwells = [
        (int(phases.stop[a]), float(epochs.start[a]), float(epochs.end[b - 1]))
        for a, b in zip(edges[::2], edges[1::2], strict=True)
    ]
    dwells = [d for d in dwells if d[2] - d[1] >= 3.0]
    turns = [(a[0], a[2], b[1]) for a, b in pairwise(dwells)]
    return Timetable(float(epochs.end[-1]), tuple(dwells), tuple(turns))


def navigation_pass(prepared: PreparedData, setup: TestSetup, finished: Pass) -> Pass:
    """Repeat the last pass with the coefficients known at their final values: only navigation errors are estimated."""
    p = len(setup.sensors.prior)
    start = finished.start
    x, P = start.x.copy(), start.P.copy()
    # About the final coefficients: the deviation is zero and has no variance.
    x[NAV : NAV + p] = 0.0
    P[NAV : NAV + p, :] = P[:, NAV : NAV + p] = 0.0
    state = PassState(x, P, start.C_nb.copy(), start.velocity.copy(), start.position.copy(), finished.estimate.copy())
    output = new_output(len(prepared.epochs), p, True, len(prepared.epochs))
    begin = PassState(*(v.copy() for v in state))
    settings = pass_settings(setup, closed_loop=False)
    run_pass(finished.data._replace(kind=prepared.kind), settings, state, output)
    return Pass(finished.C_start, begin, state, output, finished.data, settings)


def predicted_motion(prepared: PreparedData, setup: TestSetup, finished: Pass) -> Motion:
    """Motion that the finished calibration predicts."""
    return motion(
        prepared.cycles, prepared.rest, setup.sensors, finished.estimate, finished.C_start.copy(),
        setup.site.latitude_rad, setup.gravity, prepared.temperature, predicted=True,
    )  # fmt: skip


def collect(prepared: PreparedData, setup: TestSetup, finished: Pass, effects: Sequence[Effect]) -> Evidence:
    """Run the navigation filter and the signature recursion.

    Parameters
    ----------
    prepared, setup : PreparedData, TestSetup
    finished : Pass
        The last pass of a converged calibration.
    effects : sequence of Effect
        Each of their parameters becomes a candidate.
    """
    known = navigation_pass(prepared, setup, finished)
    seen = predicted_motion(prepared, setup, finished)
    sensors = setup.sensors
    candidates = [c for effect in effects for c in split(effect)]
    W = columns(prepared, known.output, seen, setup.site.latitude_rad, [*sensors.effects, *effects])
    epoch, channel = measured_rows(known.output)
    prior = np.array([c.effect.prior.get(setup.imu.grade, np.inf) for c in candidates])
    return Evidence(
        e=known.output.normalised[epoch, channel], W=W, epoch=epoch, channel=channel, stop=prepared.phases.stop[epoch],
        names=(*sensors.names, *(c.label for c in candidates)),
        weight=1.0 / sensors.prior**2, shift=-finished.estimate, stated=sensors.stated, candidates=tuple(candidates),
        prior=prior,
        grade=setup.imu.grade,
        output=known.output, seen=seen, times=timetable(prepared), prepared=prepared, latitude=setup.site.latitude_rad,
    )  # fmt: skip


_BLOCK = 24
"""Effects whose regressors are in memory at a time, in each thread."""
_THREADS = 2
"""Of a small machine; more blocks at a time than it has caches for gain nothing."""


def columns(
    prepared: PreparedData, output: PassOutput, seen: Motion, latitude: float, effects: Sequence[Effect]
) -> Floats:
    """Signatures of all parameters of `effects` at a latitude (rad), shape (N, parameters)."""
    blocks = [effects[start : start + _BLOCK] for start in range(0, len(effects), _BLOCK)]
    ends = np.cumsum([0, *(sum(len(effect.parameters) for effect in block) for block in blocks)])
    # Column by column in memory: what is chosen of them later is a few columns.
    W = np.zeros((int(np.isfinite(output.normalised).sum()), int(ends[-1])), order="F")

    def fill(number: int) -> None:
        block, epochs = blocks[number], prepared.epochs
        values = np.empty((len(seen.t), sum(len(effect.terms) for effect in block)))
        channel, parameter, terms, parameters = [], [], 0, 0
        for effect in block:
            values[:, terms : terms + len(effect.terms)] = effect.regressors(seen)
            channel += [t.channel for t in effect.terms]
            parameter += [parameters + t.parameter for t in effect.terms]
            terms += len(effect.terms)
            parameters += len(effect.parameters)
        signatures(
            seen, epochs.first, epochs.last, prepared.kind, output, values,
            np.array(channel, dtype=np.int64), np.array(parameter, dtype=np.int64), latitude,
            W[:, ends[number] : ends[number + 1]],
        )  # fmt: skip

    # The recursion of one column knows nothing of the others, and compiled loops run beside each other.
    with ThreadPoolExecutor(_THREADS) as pool:
        list(pool.map(fill, range(len(blocks))))
    return W
