"""Noise of the unit: of one size in all recordings of a set, or of its own in each.

Noise comes from the sensors, and the sensors are the same in all recordings: what one recording hardly shows, all of
them together may. So each kind of noise is of the unit or of single recordings, and both are weighed:

    p = 1/2 prod_r p(K) p(s_r) + 1/2 p(K) int p(s) prod_r N(s_r; s, delta^2) ds

with s_r the log of the size in recording r. The likelihood of a size is taken as normal in its log: mode and width of
the posterior, which the share of the sizes says (`NoiseModel.shares`), without the prior that is in both.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.evidence.learned_noise import TAU_RATIO
from sdimu_calibration.core.noise_term import DRAWN, NoiseTerm
from sdimu_calibration.core.posterior.noise_models import NoiseModel, Sizes, log_odds

_OF_UNIT = 0.5
"""Probability (1) that noise of a kind is of the unit: sensors are the same in all recordings, benches are not."""
_ALIKE = 0.2
"""Standard deviation of the log of a size (1) among recordings where it is of the unit: temperature and age change
noise by a fifth."""
_ONE_TIME = TAU_RATIO**1.5
"""Ratio (1) of the time constants of recordings up to which they may be one: a step of those that are tried."""
_UNKNOWN = 1e-3
"""Information on a size over that of its prior (1) that stands for none: a wider posterior is rounding."""
Kind = tuple[str, str, tuple[int, ...]]
"""Triad, kind and sensors of a term."""


def kind_of(term: NoiseTerm) -> Kind:
    """Say what recordings must have alike for noise to be that of the unit."""
    return term.triad, term.kind, term.axes


def log_prior_of_set(own: Sequence[NoiseModel], usual: Sizes) -> float:
    """Log prior (1) of the noises of all recordings, over white noise in all.

    Parameters
    ----------
    own : sequence of NoiseModel
        Of each recording.
    """
    terms: dict[Kind, list[tuple[NoiseTerm, float]]] = {}
    total = 0.0
    for noise in own:
        for term, share in zip(noise.terms, noise.shares, strict=True):
            # What hangs on attitude or turns is of the sensors no more than of the bench.
            if term.kind in DRAWN or len(own) < 2:
                total += share
            else:
                terms.setdefault(kind_of(term), []).append((term, share))
    for found in terms.values():
        apart = np.log(1.0 - _OF_UNIT) + sum(share for _, share in found)
        everywhere = len(found) == len(own) and _one_time([term.tau for term, _ in found])
        alike = np.log(_OF_UNIT) + _of_unit(found, usual) if everywhere else -np.inf
        total += float(np.logaddexp(apart, alike))
    return total


def _one_time(tau: Sequence[float]) -> bool:
    """Whether the time constants (s) of recordings may be one; those of noise without one are zero."""
    return bool(max(tau) <= _ONE_TIME * min(tau))


def _of_unit(found: Sequence[tuple[NoiseTerm, float]], usual: Sizes) -> float:
    """Log prior (1) of a kind of noise that is of the unit, by the term and its share in each recording.

    Where recordings have different time constants that may be one, its log odds are the mean of theirs.
    """
    first = found[0][0]
    centre, spread = np.log(usual.centre[first.triad, first.kind]), usual.spread[first.triad, first.kind]
    size: Floats = np.array([term.size for term, _ in found])
    share = np.array([share for _, share in found])
    odds = np.array([log_odds(term) for term, _ in found])
    mode = np.log(size) - centre
    of_posterior = np.exp(2.0 * (share - odds - usual.log_density(first, size))) / (2.0 * np.pi)
    # Of the likelihood: a posterior as wide as the prior says that the data know nothing.
    width2 = 1.0 / np.maximum(1.0 / of_posterior - 1.0 / spread**2, _UNKNOWN / spread**2)
    at = mode * (1.0 + width2 / spread**2)
    wider2 = width2 + _ALIKE**2
    known = 1.0 / spread**2 + float(np.sum(1.0 / wider2))
    pull = float(np.sum(at / wider2))
    squares = float(np.sum(at**2 / wider2))
    return float(
        odds.mean()
        + 0.5 * (pull**2 / known - squares)
        - 0.5 * np.log(spread**2 * known)
        # The share is that of the size at the mode of the posterior, not of the likelihood.
        + 0.5 * np.sum(np.log(width2 / wider2) + (at - mode) ** 2 / width2)
    )
