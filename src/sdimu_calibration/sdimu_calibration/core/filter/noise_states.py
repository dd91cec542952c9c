"""Noise with a memory as states of the filter on the way, so that its sigmas hold while a test runs.

A bias that wanders is no constant: a filter that takes it for one averages it as if it were white, and its sigmas fall
below the wander. Random walk is one state a sensor. Flicker is a sum of Gauss-Markov states, a decade of time constant
apart. Beside them stands the mean of each sensor's noise over the rests so far: a bias is stated in the mean over the
dwells, as at the end of a test.

Sources: IEEE Std 952-1997, annex C; K. Keshner, "1/f noise", Proc. IEEE 70 (1982) (flicker as a sum of Markov terms).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from sdimu_calibration.core.arrays import Floats, Ints
from sdimu_calibration.core.effects import bias
from sdimu_calibration.core.effects.effect import ACCEL, GYRO, REFERENCES, Effect, Parameter, Term
from sdimu_calibration.core.effects.imu_model import ImuModel, with_serving
from sdimu_calibration.core.effects.motion import Motion
from sdimu_calibration.core.noise_term import FLICKER, RANDOM_WALK, TRIADS, NoiseTerm
from sdimu_calibration.core.specification import EPOCH_S

_TAUS_S = (2.0, 20.0, 200.0, 2e3, 2e4)
"""Time constants of the Markov states of flicker (s): what is faster than the first is left to white noise, and what is
slower than the last is a constant within a test. A decade apart, the density ripples by 6 %."""
_DECADE = float(np.log(10.0))
"""Logarithm of the ratio of neighbouring time constants (1): each state has the variance of this much of the density
``B^2 / (2 pi f)``."""
_AXES = "xyz"
_CHANNELS = dict(zip(TRIADS, (GYRO, ACCEL), strict=True))


@dataclass(frozen=True)
class _State:
    """One Markov state or random walk of each sensor of a triad.

    `sigma` where the filter begins (SI); `decay_rate` (1/s); `drive`, the variance that a second adds (SI^2/s).
    """

    label: str
    sigma: float
    decay_rate: float
    drive: float


@dataclass(frozen=True)
class NoiseStates:
    """Where the states of noise stand among the coefficients of a filter."""

    wander: Ints
    """Places of the noise of single sensors, shape (w,)."""
    mean: Ints
    """Places of the mean of the noise of each sensor over the rests so far, shape (c,)."""
    adds: Floats
    """1 where a state is noise of that sensor, else 0, shape (c, w)."""
    moved: Floats
    """Shape (p, p + w + c). What is reported of p coefficients by all that are estimated: biases with the mean of their
    noise (1)."""

    @property
    def averaged(self) -> Ints:
        """Places as `PassSettings.averaged` has them, shape (w, 2)."""
        of, which = np.nonzero(self.adds)
        return np.ascontiguousarray(np.column_stack([self.wander[which], self.mean[of]]))


def with_noise_states(sensors: ImuModel, terms: Sequence[NoiseTerm]) -> tuple[ImuModel, NoiseStates | None]:
    """Put noise with a memory behind a model, as parameters that serve.

    Parameters
    ----------
    sensors : ImuModel
        p coefficients, those that serve among them.
    terms : sequence of NoiseTerm
        Flicker and random walk, as IMU files state them.

    Returns
    -------
    sensors : ImuModel
    states : NoiseStates or None
        None without terms.
    """
    if not terms:
        return sensors, None
    p = len(sensors.names)
    triads = [triad for triad in TRIADS if any(term.triad == triad for term in terms)]
    states = [[state for term in terms if term.triad == triad for state in _states(term)] for triad in triads]
    channel = np.array([c for triad, own in zip(triads, states, strict=True) for _ in own for c in _CHANNELS[triad]])
    averaged = np.array([c for triad in triads for c in _CHANNELS[triad]])
    effects = [*map(_noise, triads, states), *map(_mean, triads)]
    every = [*(state for own in states for state in own), *(_State("mean", 0.0, 0.0, 0.0) for _ in triads)]
    columns = np.array([(s.sigma, s.decay_rate, s.drive) for s in every]).repeat(len(_AXES), axis=0)
    wander, mean = p + np.arange(len(channel)), p + len(channel) + np.arange(len(averaged))
    moved = np.eye(p, p + len(channel) + len(averaged))
    for name, place in zip(np.array(bias.NAMES)[averaged].tolist(), mean.tolist(), strict=True):
        if name in sensors.names:
            moved[sensors.names.index(name), place] = 1.0
    adds = (averaged[:, None] == channel).astype(np.float64)
    return with_serving(sensors, effects, *columns.T), NoiseStates(wander, mean, adds, moved)


def _states(term: NoiseTerm) -> Iterator[_State]:
    if term.kind == RANDOM_WALK:
        # At the start the walk is nowhere yet: what it is after one epoch.
        yield _State(RANDOM_WALK, term.size * float(np.sqrt(EPOCH_S)), 0.0, term.size**2)
    elif term.kind == FLICKER:
        variance = term.size**2 * _DECADE / np.pi
        for tau in _TAUS_S:
            # As much comes in as fades, so that the variance stays.
            yield _State(f"{FLICKER}(tau={tau:g} s)", float(np.sqrt(variance)), 1.0 / tau, 2.0 * variance / tau)
    else:
        raise ValueError(f"noise '{term.kind}': the filter has states for {FLICKER} and {RANDOM_WALK}")


def _noise(triad: str, states: Sequence[_State]) -> Effect:
    """Make the noise of a triad: parameters state by state, one an axis."""
    columns = len(states) * len(_AXES)

    def ones(motion: Motion) -> Floats:
        return np.ones((len(motion.t), columns))

    terms = tuple(
        Term(channel, 3 * k + axis) for k in range(len(states)) for axis, channel in enumerate(_CHANNELS[triad])
    )
    return _effect(triad, [state.label for state in states], terms, ones)


def _mean(triad: str) -> Effect:
    """Make the mean of the noise of a triad, which by itself shows in no sample."""
    return _effect(triad, ["mean"], (), _nothing)


def _effect(
    triad: str, labels: Sequence[str], terms: tuple[Term, ...], regressors: Callable[[Motion], Floats]
) -> Effect:
    unit, shown = ("rad/s", "deg/h") if triad == "gyro" else ("m/s^2", "ug")
    names = [f"{triad}_noise_{label}_{axis}" for label in labels for axis in _AXES]
    return Effect(
        name=f"{triad}_noise_{labels[0]}",
        title="noise with a memory",
        equation="",
        parameters=tuple(Parameter(name, unit, shown) for name in names),
        terms=terms,
        regressors=regressors,
        prior={},
        group=REFERENCES,
        scope="recording",
    )


def _nothing(motion: Motion) -> Floats:
    return np.empty((len(motion.t), 0))
