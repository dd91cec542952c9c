"""Evidence of a navigation: whitened innovations, and the signature of every known and suspected parameter.

The navigation filter runs once more with the coefficients known at their final values, so that only navigation errors
are estimated. An effect shows in corrected samples through the inverse slope of the sensor errors.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from sdimu_calibration.core.alignment.alignment import Alignment
from sdimu_calibration.core.alignment.prepared import PreparedData, TestSetup
from sdimu_calibration.core.arrays import Floats, Ints
from sdimu_calibration.core.effects.effect import Effect, Timetable
from sdimu_calibration.core.effects.motion import Motion
from sdimu_calibration.core.evidence.attitude_functions import AttitudeFunctions, attitude_functions
from sdimu_calibration.core.evidence.conditions import Conditions, conditions
from sdimu_calibration.core.evidence.linear import LinearEvidence, candidate_priors
from sdimu_calibration.core.evidence.noise_kernels import Stretches
from sdimu_calibration.core.evidence.signatures import (
    Epochs,
    Regressors,
    constant_signatures,
    measured_rows,
    signatures,
)
from sdimu_calibration.core.filter.filter_pass import NAV, PassOutput, PassState
from sdimu_calibration.core.filter.pass_loop import Pass
from sdimu_calibration.core.filter.pass_setup import firm_setup
from sdimu_calibration.core.filter.passes import begun, linearise, run_linearised
from sdimu_calibration.core.side_by_side import side_by_side

_SHORTEST_DWELL_S = 3.0
"""Shortest dwell (s): what is shorter is a part of the turn."""
_BLOCK = 48
"""Number of stretches that a thread works on at a time: fewer would repeat the response of the navigation."""
_EFFECTS = 24
"""Number of effects that a thread works on at a time: fewer would repeat the response of the navigation, the regressors
of more over an hour leave its cache."""


@dataclass(frozen=True)
class KnownPass:
    """A navigation with the coefficients known."""

    output: PassOutput
    """With the matrices of every epoch."""
    seen: Motion
    """Motion along which it was linearised, n cycles."""
    weight: Floats
    """Shape (n, 6, 6). Change of corrected rate and force per change of the measured ones."""


@dataclass(frozen=True)
class NavigationEvidence(LinearEvidence):
    """Innovations of the navigation filter about a calibration that converged; every parameter is a coefficient."""

    epoch: Ints
    channel: Ints
    """`epoch`, `channel`: shape (N,). Of each row; channels 0-11 are position, velocity, rate, force, three each."""
    known: KnownPass
    prepared: PreparedData
    latitude: float
    """Of the site (rad)."""

    @property
    def output(self) -> PassOutput:
        """Output of the navigation filter."""
        return self.known.output

    @property
    def seen(self) -> Motion:
        """Predicted motion."""
        return self.known.seen

    def signature(self, effects: Sequence[Effect]) -> Floats:
        """Signatures of all parameters of some effects."""
        return self._whitened(columns(self.prepared, self.known, self.latitude, effects))

    def constant_signature(self, cut: Stretches) -> Floats:
        """Signatures of a constant error of each sensor axis in each stretch."""
        return self._whitened(constant_columns(self.prepared, self.known, self.latitude, cut))

    def _whitened(self, W: Floats) -> Floats:
        return W if self.inner is None else self.inner.whitened(W)

    @property
    def row_times(self) -> Floats:
        """Time at the end of the epoch of each row (s), shape (N,)."""
        return np.asarray(self.prepared.epochs.end[self.epoch])

    def conditions(self, cut: Stretches) -> Conditions:
        """Give what an unknown error may follow in each stretch."""
        return conditions(self.seen, cut.start, cut.end)

    def attitude_functions(self) -> AttitudeFunctions:
        """Give functions of the attitude, which the navigation knows in every cycle."""
        return attitude_functions(self.seen, [(begin, end) for _, begin, end in self.times.stops])


def timetable(prepared: PreparedData) -> Timetable:
    """When the recording stood and turned, from the phases of the epochs."""
    phases, epochs = prepared.phases, prepared.epochs
    edges = np.flatnonzero(np.diff(np.concatenate([[0], phases.dwell.astype(int), [0]])))
    dwells = [
        (int(phases.stop[a]), float(epochs.start[a]), float(epochs.end[b - 1]))
        for a, b in zip(edges[::2], edges[1::2], strict=True)
    ]
    dwells = [d for d in dwells if d[2] - d[1] >= _SHORTEST_DWELL_S]
    turns = [(a[0], a[2], b[1]) for a, b in pairwise(dwells)]
    return Timetable(float(epochs.end[-1]), tuple(dwells), tuple(turns))


def known_pass(prepared: PreparedData, setup: TestSetup, start: Alignment, finished: Pass) -> KnownPass:
    """Run a pass about samples corrected exactly at the final coefficients, which are known.

    Shifts of the attitude between stops change no covariance, so the recursion of the signatures holds as it stands.
    """
    firm, estimate = firm_setup(setup), finished.estimate
    at = linearise(prepared, firm, finished.smoothed_start, estimate)
    begin = _with_known_coefficients(begun(at, firm, start), len(estimate))
    done = run_linearised(at, firm, begin, keep=True)
    return KnownPass(done.output, at.seen, at.weight)


def _with_known_coefficients(start: PassState, p: int) -> PassState:
    """Copy a state with the deviations of the first `p` coefficients at zero, without variance."""
    state = PassState(*(v.copy() for v in start))
    state.x[NAV : NAV + p] = 0.0
    state.P[NAV : NAV + p, :] = state.P[:, NAV : NAV + p] = 0.0
    return state


def navigation_evidence(
    prepared: PreparedData,
    setup: TestSetup,
    known: KnownPass,
    estimate: Floats,
    effects: Sequence[Effect],
    found: tuple[Effect, ...] = (),
) -> NavigationEvidence:
    """Put whitened innovations and signatures together.

    Parameters
    ----------
    estimate : ndarray, shape (p,)
        Coefficients of the model (SI), at which `known` ran; it ran without those that fade.
    effects : sequence of Effect
        Each of their parameters becomes a candidate.
    found : tuple of Effect
        As of `LinearEvidence`.
    """
    sensors, latitude = setup.sensors, setup.site.latitude_rad
    epoch, channel = measured_rows(known.output)
    candidates, prior = candidate_priors(effects, setup.imu)
    return NavigationEvidence(
        e=known.output.normalised[epoch, channel],
        W=columns(prepared, known, latitude, [*sensors.effects, *effects]),
        stop=prepared.phases.stop[epoch],
        names=(*sensors.names, *(c.label for c in candidates)),
        weight=sensors.weight,
        shift=sensors.mean - estimate * (sensors.decay_rate == 0.0),
        stated=sensors.stated,
        candidates=candidates,
        prior=prior,
        imu=setup.imu,
        times=timetable(prepared),
        coefficients=len(sensors.prior) - sensors.serving,
        found=found,
        epoch=epoch,
        channel=channel,
        known=known,
        prepared=prepared,
        latitude=latitude,
    )


def columns(prepared: PreparedData, known: KnownPass, latitude: float, effects: Sequence[Effect]) -> Floats:
    """Signatures of all parameters of some effects, in parallel.

    Parameters
    ----------
    latitude : float
        Of the site (rad).

    Returns
    -------
    ndarray, shape (N, parameters)
        Change of each whitened innovation per SI unit of each parameter; rows in the order of `measured_rows`.
    """
    epochs, seen = _epochs(prepared), known.seen
    blocks = [effects[start : start + _EFFECTS] for start in range(0, len(effects), _EFFECTS)]
    ends = np.cumsum([0, *(sum(len(effect.parameters) for effect in block) for block in blocks)])
    # Column by column in memory: what is chosen of them later is a few columns.
    W = np.zeros((int(np.isfinite(known.output.normalised).sum()), int(ends[-1])), order="F")

    def fill(number: int) -> None:
        part = W[:, ends[number] : ends[number + 1]]
        signatures(seen, epochs, known.output, _terms(blocks[number], seen), latitude, known.weight, part)

    # The recursion of one column knows nothing of the others, and compiled loops run beside each other.
    side_by_side(fill, range(len(blocks)))
    return W


def constant_columns(prepared: PreparedData, known: KnownPass, latitude: float, cut: Stretches) -> Floats:
    """Signatures of a constant error of each sensor axis in each stretch, in parallel.

    Parameters
    ----------
    latitude : float
        Of the site (rad).
    cut : Stretches
        s stretches.

    Returns
    -------
    ndarray, shape (N, 6 s)
        Change of each whitened innovation per rad/s or m/s^2; column ``6 stretch + axis``, rows in the order of
        `measured_rows`.
    """
    epochs, blocks = _epochs(prepared), range(0, len(cut), _BLOCK)
    W = np.zeros((int(np.isfinite(known.output.normalised).sum()), 6 * len(cut)), order="F")

    def fill(begin: int) -> None:
        part = slice(begin, min(begin + _BLOCK, len(cut)))
        constant_signatures(
            known.seen,
            epochs,
            known.output,
            cut.start[part],
            cut.end[part],
            latitude,
            known.weight,
            W[:, 6 * part.start : 6 * part.stop],
        )

    side_by_side(fill, blocks)
    return W


def _epochs(prepared: PreparedData) -> Epochs:
    return Epochs(prepared.epochs.first, prepared.epochs.last, prepared.kind)


def _terms(effects: Sequence[Effect], seen: Motion) -> Regressors:
    """Regressors of effects along a motion."""
    # Each effect writes whole columns; the loops over cycles read rows, of a copy.
    values = np.empty((len(seen.t), sum(len(effect.terms) for effect in effects)), order="F")
    channel: list[int] = []
    parameter: list[int] = []
    parameters = 0
    for effect in effects:
        values[:, len(channel) : len(channel) + len(effect.terms)] = effect.regressors(seen)
        channel += [t.channel for t in effect.terms]
        parameter += [parameters + t.parameter for t in effect.terms]
        parameters += len(effect.parameters)
    return Regressors(values, np.array(channel, dtype=np.int64), np.array(parameter, dtype=np.int64))
