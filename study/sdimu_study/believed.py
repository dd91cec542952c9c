"""Worlds as the diagnosis believes them: effects and noise drawn from its prior, made by the simulator.

In such worlds probabilities must come true. If they do, probabilities that do not come true in other worlds are a
matter of the prior; if they do not, of the search or of the likelihood. What is not hidden (`BelievedEffects`), one to
three hundredths of the prior, is drawn and left out. That effects of one cause on several axes are likelier together
counts in which ones are drawn, and not in how many. Source: S. Talts et al., "Validating Bayesian inference algorithms
with simulation-based calibration", arXiv 1804.06788 (2018).
"""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.diagnosis.ground import Request, fresh_ground
from sdimu_calibration.core.diagnosis.scan import scan
from sdimu_calibration.core.diagnosis.search import FALSE_ALARM
from sdimu_calibration.core.effect_key import sized
from sdimu_calibration.core.estimation.fit import Fit
from sdimu_calibration.core.evidence.learned_noise import MOST_TERMS
from sdimu_calibration.core.evidence.linear import LinearEvidence
from sdimu_calibration.core.evidence.stretch_length import wander_in
from sdimu_calibration.core.noise_term import MARKOV, RANDOM_WALK, TRIADS, NoiseTerm
from sdimu_calibration.core.posterior.board import Board
from sdimu_calibration.core.posterior.noise_models import MARKOV_S, MARKOV_SPREAD, ODDS, usual_sizes
from sdimu_calibration.core.posterior.prior import MEAN_NUMBER, WIDTH_SHARES, WIDTHS
from sdimu_calibration.core.specification import ImuSpecification
from sdimu_calibration.core.units import from_si
from sdimu_sim.core.coloured import KINDS
from sdimu_sim.core.hidden import effect_names, one_sided, size_unit
from sdimu_study.worlds import TESTABLE, Truth, option_of


def believed_count(rng: np.random.Generator) -> int:
    """Draw how many effects a sensor has: a rate that is exponentially distributed, then the number at that rate."""
    return int(rng.poisson(rng.exponential(MEAN_NUMBER)))


def believed_noise(imu: ImuSpecification, duration_s: float, rng: np.random.Generator) -> tuple[str, ...]:
    """Draw noise with a memory: each kind of the simulator with its odds, two terms a triad at most, of usual sizes.

    Gauss-Markov noise of more than a third of the test is left out, as a diagnosis does not look for it.
    """
    usual, out = usual_sizes(imu), []
    for triad, unit in zip(TRIADS, ("deg/h", "ug"), strict=True):
        kinds: list[str] = list(KINDS)
        while len(kinds) > MOST_TERMS:
            kinds = [kind for kind in KINDS if rng.random() < ODDS[kind] / (1.0 + ODDS[kind])]
        for kind in kinds:
            size = usual.centre[triad, kind] * float(np.exp(usual.spread[triad, kind] * rng.standard_normal()))
            shown = f"{unit}/sqrt(h)" if kind == RANDOM_WALK else unit
            tau_s = MARKOV_S * float(np.exp(MARKOV_SPREAD * rng.standard_normal()))
            time = f"(tau={tau_s:.0f} s)" if kind == MARKOV else ""
            if kind != MARKOV or tau_s < duration_s / 3.0:
                out.append(f"{triad}_noise_{kind}{time}={float(from_si(size, shown)):.5g} {shown}")
    return tuple(out)


class BelievedEffects:
    """Draws the effects of one world one after another, each beside those before it.

    Parameters
    ----------
    rng : Generator
    noise : sequence of NoiseTerm
        Noise with a memory that the sigmas of the truths count.
    left_out : collection of str
        Families that are not hidden.
    """

    def __init__(self, rng: np.random.Generator, noise: Sequence[NoiseTerm], left_out: Collection[str] = ()) -> None:
        self._rng, self._noise, self._left_out = rng, noise, left_out
        self._prepared: tuple[Board[LinearEvidence], Floats, Floats] | None = None
        self._places: list[int] = []

    def __call__(self, fit: Fit) -> Truth | None:
        """Draw the next effect; None where it is one that is not hidden.

        Not hidden are families that are left out, what the simulator does not have, and what the priors of the
        coefficients alone tell from these: a large one is found as a coefficient.

        Parameters
        ----------
        fit : Fit
            Of the clean test.
        """
        self._prepared = self._prepared or _prepared(fit, self._noise)
        (board, sigma, apart), rng = self._prepared, self._rng
        odds = board.prior.log_more(sorted(self._places))
        share = np.exp(odds - odds.max())
        place = int(rng.choice(len(share), p=share / share.sum()))
        self._places.append(place)
        width, unit = float(rng.choice(WIDTHS, p=WIDTH_SHARES)), float(board.size[place])
        value = unit * width * float(rng.standard_normal())
        column = int(board.use[place])
        candidate = board.evidence.candidate(column)
        name = candidate.parameter.name
        if name not in effect_names() or candidate.family in self._left_out or apart[column] < TESTABLE:
            return None
        value = abs(value) if one_sided(name) or candidate.effect.positive else value
        text = sized(candidate.label, value, size_unit(name))
        return Truth(name, candidate.family, option_of(candidate.label), value, abs(value) / float(sigma[column]), text)


def _prepared(fit: Fit, noise: Sequence[NoiseTerm]) -> tuple[Board[LinearEvidence], Floats, Floats]:
    """Take all that may be in a model of the clean test.

    Returns
    -------
    board : Board
        With the candidates of a diagnosis.
    sigma : ndarray, shape (columns,)
        Of each column of its evidence in the noise (SI).
    apart : ndarray, shape (columns,)
        Share of the signature of each that coefficients without priors leave (1).
    """
    ground = fresh_ground(Request(fit, (), FALSE_ALARM), fit, (), own=False)
    noisy = ground.evidence
    if noise:
        noisy = noisy.with_noise(wander_in(fit.evidence(), noise).modes(noise).columns)
    sigma = scan(noisy.information, noisy.model, noisy.weight).sigma
    one = ground.evidence
    apart = scan(one.information, one.model, 1e-9 * one.weight).retention
    return Board(one, ground.allowed, frozenset(), None), sigma, apart
