"""Worlds as the diagnosis believes them: effects and noise of its prior, made by the simulator.

In such worlds all that is told must come true. Where it does, what is told wrongly elsewhere is of the prior; where it
does not, of the search or of the likelihood. Source: S. Talts et al., "Validating Bayesian inference algorithms with
simulation-based calibration", arXiv 1804.06788 (2018).
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np

from sdimu_calibration.core.diagnosis.candidates import catalogue
from sdimu_calibration.core.diagnosis.scan import scan
from sdimu_calibration.core.effect_key import sized
from sdimu_calibration.core.estimation.fit import Fit
from sdimu_calibration.core.evidence.linear import LinearEvidence
from sdimu_calibration.core.evidence.stretch_length import wander_in
from sdimu_calibration.core.noise_term import MARKOV, RANDOM_WALK, TRIADS, NoiseTerm
from sdimu_calibration.core.posterior.board import Board
from sdimu_calibration.core.posterior.noise_models import MARKOV_S, MARKOV_SPREAD, ODDS, usual_sizes
from sdimu_calibration.core.posterior.prior import MEAN_NUMBER, WIDTH_SHARES, WIDTHS
from sdimu_calibration.core.specification import ImuSpecification
from sdimu_calibration.core.units import from_si
from sdimu_sim.core.coloured import KINDS
from sdimu_sim.core.hidden import one_sided, size_unit
from sdimu_study.worlds import Truth, hideable_names, option_of

_MOST_TERMS = 2
"""Number of noise terms of a triad at most (1), as a diagnosis looks for them."""


def believed_count(rng: np.random.Generator) -> int:
    """Draw how many effects a sensor has: a rate that is exponentially distributed, then the number at that rate."""
    return int(rng.poisson(rng.exponential(MEAN_NUMBER)))


def believed_noise(imu: ImuSpecification, rng: np.random.Generator) -> tuple[str, ...]:
    """Draw noise with a memory: each kind that the simulator has with its odds, of a usual size for the IMU."""
    usual, out = usual_sizes(imu), []
    for triad, unit in zip(TRIADS, ("deg/h", "ug"), strict=True):
        kinds: list[str] = list(KINDS)
        while len(kinds) > _MOST_TERMS:
            kinds = [kind for kind in KINDS if rng.random() < ODDS[kind] / (1.0 + ODDS[kind])]
        for kind in kinds:
            size = usual.centre[triad, kind] * float(np.exp(usual.spread[triad, kind] * rng.standard_normal()))
            shown = f"{unit}/sqrt(h)" if kind == RANDOM_WALK else unit
            tau = f"(tau={MARKOV_S * float(np.exp(MARKOV_SPREAD * rng.standard_normal())):.0f} s)"
            out.append(f"{triad}_noise_{kind}{tau if kind == MARKOV else ''}={float(from_si(size, shown)):.5g} {shown}")
    return tuple(out)


@dataclass
class BelievedEffects:
    """Draws the effects of one world one after another, each beside those before it.

    Attributes
    ----------
    rng : Generator
    noise : sequence of NoiseTerm
        Noise with a memory that the sigmas of the truths count.
    told_before : collection of str
        Families that are left out.
    """

    rng: np.random.Generator
    noise: Sequence[NoiseTerm]
    told_before: Collection[str] = ()

    def __post_init__(self) -> None:
        self._board: Board[LinearEvidence] | None = None
        self._drawn: list[int] = []

    def __call__(self, fit: Fit) -> Truth:
        """Draw the next effect.

        Parameters
        ----------
        fit : Fit
            Of the clean test.
        """
        if self._board is None:
            self._prepare(fit)
        board, rng = self._board, self.rng
        assert board is not None
        odds = board.prior.log_more(sorted(self._drawn)) + self._possible
        share = np.exp(odds - odds.max())
        k = int(rng.choice(len(share), p=share / share.sum()))
        self._drawn.append(k)
        column = int(board.use[k])
        candidate = board.evidence.candidate(column)
        name = candidate.parameter.name
        width = float(rng.choice(WIDTHS, p=WIDTH_SHARES))
        value = float(board.size[k]) * width * float(rng.standard_normal())
        value = abs(value) if one_sided(name) or candidate.effect.positive else value
        sigmas = abs(value) / float(self._sigma[column])
        text = sized(candidate.label, value, size_unit(name))
        return Truth(name, candidate.family, option_of(candidate.label), value, sigmas, text)

    def _prepare(self, fit: Fit) -> None:
        """Take the evidence of the clean test, with all that may be in a model."""
        known = catalogue(fit.timetable, set(fit.labels), has_temperature=False)
        known = [e for e in known if not (fit.learns_scatter and (e.options or e.needs_table))]
        evidence = fit.evidence(known)
        p = len(evidence.weight)
        self._board = Board(evidence, np.arange(p, p + len(evidence.candidates)), frozenset(), None)
        names = hideable_names()
        candidates = [evidence.candidate(int(column)) for column in self._board.use]
        can = [c.parameter.name in names and c.family not in self.told_before for c in candidates]
        self._possible = np.where(can, 0.0, -np.inf)
        noisy = evidence
        if self.noise:
            noisy = evidence.with_noise(wander_in(fit.evidence(), self.noise).modes(self.noise).columns)
        self._sigma = scan(noisy.information, noisy.model, noisy.weight).sigma
