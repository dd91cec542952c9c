"""Noise with a memory as part of a model: which terms, of which sizes, each with its probability before the data.

A term's size is not known: its logarithm is normal about what a data sheet states, or what is usual.
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.evidence.learned_noise import TAU_RATIO, kinds
from sdimu_calibration.core.evidence.noise_kernels import Stretches
from sdimu_calibration.core.noise_term import (
    AXES,
    DRAWN,
    FLICKER,
    FOLLOWS,
    MARKOV,
    RANDOM_WALK,
    SHIFT,
    STOP,
    TRIADS,
    TURN,
    Identity,
    NoiseTerm,
)
from sdimu_calibration.core.specification import ImuSpecification
from sdimu_calibration.core.units import to_si

ODDS: Mapping[str, float] = {
    RANDOM_WALK: 0.35,
    FLICKER: 0.4,
    MARKOV: 0.4,
    STOP: 0.1,
    TURN: 0.1,
    SHIFT: 0.25,
    **dict.fromkeys(FOLLOWS, 0.02),
}
"""Odds of each kind of noise in a triad beside none (1): every sensor has bias instability and a rate random walk of
some size, IEEE Std 952; what is drawn anew at stops or turns has a cause that nobody knows."""
STATED_SPREAD = 1.0
"""Standard deviation of the log of a size about that of a data sheet (1): a factor of 2.7."""
USUAL_SPREAD = 2.3
"""Standard deviation of the log of a size where no data sheet states one (1): a factor of ten."""
MARKOV_S = 300.0
"""Usual time constant of Gauss-Markov noise (s): an estimate, about what the simulated worlds draw (100 to 1000 s)."""
MARKOV_SPREAD = 1.2
"""Standard deviation of the log of that time constant about the usual one (1): a factor of three."""
INSTABILITY: Mapping[str, Mapping[str, float]] = {
    "gyro": {grade: to_si(size, "deg/h") for grade, size in (("navigation", 0.01), ("tactical", 1.0), ("mems", 20.0))},
    "accel": {grade: to_si(size, "ug") for grade, size in (("navigation", 2.0), ("tactical", 30.0), ("mems", 100.0))},
}
"""Bias instability (rad/s, m/s^2) of a grade where the IMU file states none: data sheets of the grade."""
SHARE: Mapping[str, float] = {
    FLICKER: 1.0,
    RANDOM_WALK: 0.664 * float(np.sqrt(3.0 / 1000.0)),
    MARKOV: 0.664,
    STOP: 0.664,
    TURN: 0.664,
    SHIFT: 0.3,
    **dict.fromkeys(FOLLOWS, 3.0),
}
"""Usual size of each kind over the bias instability (SI): a random walk has the Allan deviation of it at 1000 s."""
SENSORS = tuple(axes for count in (3, 1, 2) for axes in combinations(AXES, count))
"""Sensors of a triad that an unknown function may be of, likely alike: nobody knows what causes it."""


@dataclass(frozen=True)
class NoiseModel:
    """Noise of a model."""

    terms: tuple[NoiseTerm, ...] = ()
    """With their sizes."""
    shares: tuple[float, ...] = ()
    """Of each term the log of its odds beside none, with the share of the sizes that its likelihood leaves (1)."""

    @property
    def log_prior(self) -> float:
        """Log of its odds beside white noise, of the share of its sizes too (1)."""
        return sum(self.shares)

    @cached_property
    def sizes(self) -> Mapping[Hashable, float]:
        """Size of each term (SI), by what it is."""
        return {t.identity: t.size for t in self.terms}

    @cached_property
    def key(self) -> frozenset[Hashable]:
        """What each term is and where, its size aside."""
        return frozenset(self.sizes)

    @cached_property
    def kinds(self) -> frozenset[Identity]:
        """What each term is, its size aside."""
        return frozenset(t.identity for t in self.terms)

    @property
    def triads(self) -> frozenset[str]:
        """Triads that have noise."""
        return frozenset(t.triad for t in self.terms)

    @property
    def wanders_alone(self) -> bool:
        """Whether no term hangs on attitude, rate or turns, as a missing effect does."""
        return not any(t.kind in DRAWN for t in self.terms)

    def drawn_in(self, triad: str) -> frozenset[str]:
        """Name the kinds of the terms of a triad that hang on attitude, rate or turns."""
        return frozenset(t.kind for t in self.terms if t.triad == triad and t.kind in DRAWN)


@dataclass(frozen=True)
class Sizes:
    """Usual size of each kind of noise in each triad (SI), and the spread of its log."""

    centre: Mapping[tuple[str, str], float]
    spread: Mapping[tuple[str, str], float]

    def log_density(self, term: NoiseTerm, size: Floats) -> Floats:
        """Log density of the log of a size.

        Parameters
        ----------
        term : NoiseTerm
            Its triad and kind.
        size : ndarray, shape (n,)
            SI.

        Returns
        -------
        ndarray, shape (n,)
            (1).
        """
        key = (term.triad, term.kind)
        centre, spread = self.centre[key], self.spread[key]
        return np.asarray(-0.5 * (np.log(size / centre) / spread) ** 2 - np.log(spread * np.sqrt(2.0 * np.pi)))


def usual_sizes(imu: ImuSpecification) -> Sizes:
    """State usual sizes of noise by the data sheet of an IMU, else by its grade."""
    centre: dict[tuple[str, str], float] = {}
    spread: dict[tuple[str, str], float] = {}
    stated = {"gyro": imu.gyro_bias_instability, "accel": imu.accel_bias_instability}
    for triad in TRIADS:
        level = stated[triad] or INSTABILITY[triad][imu.grade]
        for kind in ODDS:
            centre[triad, kind] = level * SHARE[kind]
            narrow = stated[triad] and kind not in DRAWN
            spread[triad, kind] = STATED_SPREAD if narrow else USUAL_SPREAD
    walk = {"gyro": imu.gyro_random_walk, "accel": imu.accel_random_walk}
    for triad in TRIADS:
        if walk[triad]:
            centre[triad, RANDOM_WALK], spread[triad, RANDOM_WALK] = walk[triad], STATED_SPREAD
    return Sizes(centre, spread)


def log_odds(term: NoiseTerm) -> float:
    """Log odds (1) of a term beside none.

    The odds of a kind are shared by the sensors that it may be of, and by its time constants: each that is tried stands
    for all that lie nearer to it than to its neighbours.
    """
    odds = float(np.log(ODDS[term.kind]))
    if term.kind == MARKOV:
        off = np.log(term.tau / MARKOV_S) / MARKOV_SPREAD
        odds += float(np.log(np.log(TAU_RATIO) / (MARKOV_SPREAD * np.sqrt(2.0 * np.pi))) - 0.5 * off**2)
    return odds - float(np.log(len(SENSORS) if term.kind in FOLLOWS else 1))


def every_kind(cut: Stretches) -> list[NoiseTerm]:
    """List every kind of noise that is looked for in a test, without its size."""
    follows = () if cut.conditions is None else cut.conditions.followed
    unknown = [NoiseTerm(triad, kind, axes=axes) for triad in TRIADS for kind in follows for axes in SENSORS]
    return [*kinds(cut), *unknown]
