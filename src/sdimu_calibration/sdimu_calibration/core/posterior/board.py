"""Evidence with everything that scores a model on it: its candidates in any noise, and the noises beside any choice."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass
from functools import cached_property
from typing import Generic

import numpy as np

from sdimu_calibration.core.arrays import Floats, Ints
from sdimu_calibration.core.effects.effect import Effect
from sdimu_calibration.core.evidence.candidate import of_the_sensor
from sdimu_calibration.core.evidence.information import Information, solved
from sdimu_calibration.core.evidence.joint_information import Joint
from sdimu_calibration.core.evidence.linear import E
from sdimu_calibration.core.evidence.noise_root import root_of
from sdimu_calibration.core.evidence.taken import Taken, divided, nothing_taken
from sdimu_calibration.core.evidence.testable import TESTABLE
from sdimu_calibration.core.evidence.wander import Wander
from sdimu_calibration.core.noise_term import NoiseTerm
from sdimu_calibration.core.posterior.models import Data, Members, gains
from sdimu_calibration.core.posterior.noise_models import NoiseModel, usual_sizes
from sdimu_calibration.core.posterior.noise_search import explored, instead_of
from sdimu_calibration.core.posterior.prior import UNKNOWN_SIZE, WIDTHS, Prior, prior_of

_SHARPER = 1.0
"""Gain of the log Bayes factor (1) from which a time or time constant between those of the scan is taken: less is not
worth its digits."""


@dataclass(frozen=True)
class InNoise:
    """Information on p coefficients and u candidates in a noise of r modes, and what they say of the modes."""

    J: Floats
    """Inverse squares of the units (SI) of the parameters, shape (p + u, p + u)."""
    d: Floats
    """Inverse units, without the pull of the white residuals that the modes take, shape (p + u,)."""
    R: Floats
    """Mean errors in all stretches of each mode (SI), shape (6 n, r)."""
    modes: Taken
    """What the modes take of the information on the parameters in white noise."""


class Board(Generic[E]):
    """Evidence in white noise, and what may be in a model.

    Parameters
    ----------
    evidence : LinearEvidence
        In white noise.
    allowed : ndarray of int, shape (a,)
        Columns that may be in a model.
    finer : frozenset of int
        Those of them that were made between those of a scan.
    wander : Wander or None
        Of the same test; None where no noise with a memory is looked for.
    earlier : Joint, optional
        Of the same signatures, or of the first ones of them.
    """

    def __init__(
        self, evidence: E, allowed: Ints, finer: frozenset[int], wander: Wander | None, earlier: Joint | None = None
    ) -> None:
        self.evidence, self.allowed, self.finer, self.wander = evidence, allowed, finer, wander
        self.joint = None if wander is None else Joint.of(evidence, wander, earlier)
        self.excess = 1.0
        # Not itself: what refers to itself keeps its matrices until somebody looks for such rings.
        self._stated: Board[E] | None = None
        self._data: dict[NoiseModel, tuple[float, Data]] = {}
        self._in_noise: dict[NoiseModel, InNoise] = {}

    @property
    def as_stated(self) -> Board[E]:
        """The board in noise as its models state it."""
        return self if self._stated is None else self._stated

    @property
    def has_noises(self) -> bool:
        """Whether noise with a memory may be in a model."""
        return self.wander is not None

    def in_excess(self, excess: float) -> Board[E]:
        """Return the board with all noise larger than the models of it say.

        Where the best model in the best noise leaves residuals of that variance, no model of noise is right, and
        whatever it decides is decided by too much: all covariances grow, all log likelihoods fall by the same factor.
        Source: P. McCullagh, J. Nelder, "Generalized linear models" (1989), section 4.5 (overdispersion).

        Parameters
        ----------
        excess : float
            Variance over that of the noise models (1).
        """
        if excess == self.excess:
            return self
        out = copy(self)
        out.excess, out._data, out._in_noise, out._stated = excess, {}, {}, self.as_stated
        return out

    def excess_of(self, members: Members, noise: NoiseModel) -> float:
        """Variance of what a model leaves, over that of its noise (1); none below 1.

        ``(e' S^-1 e - d' A^-1 d) / (N - k)``: S is the covariance of all noise, A and d the information on coefficients
        and the k effects of the model. What is known of a coefficient before the data makes up for its degree of
        freedom.
        """
        evidence, one = self.evidence, self.as_stated.in_noise(noise)
        at = np.array([*range(len(evidence.weight)), *(len(evidence.weight) + k for k, _ in members)], dtype=np.int64)
        _, weight = self.parameters(members)
        A, d = one.J[np.ix_(at, at)] + np.diag(weight), one.d[at]
        prior = float(evidence.weight @ evidence.shift**2)
        squares, rows = self.squares(noise)
        left = squares + prior - float(d @ solved(A, d[:, None])[:, 0])
        return max(left / max(rows - len(members), 1), 1.0)

    def squares(self, noise: NoiseModel) -> tuple[float, int]:
        """Sum of the squared residuals with no effect added, in a noise (1), and their number."""
        e, one = self.evidence.e, self.as_stated.in_noise(noise)
        return float(e @ e) - float(one.modes.z @ one.modes.z), len(e)

    @cached_property
    def use(self) -> Ints:
        """Columns of the evidence that may be in a model, in the order of the candidates of `data`.

        Returns
        -------
        ndarray of int, shape (u,)
        """
        return self.testable

    @cached_property
    def testable(self) -> Ints:
        """Columns of the evidence that the coefficients do not take up.

        Returns
        -------
        ndarray of int, shape (u,)
        """
        full = self.evidence.information
        J, _ = full.diagonal_given(self.evidence.model, self.evidence.weight)
        with np.errstate(divide="ignore", invalid="ignore"):
            left = np.sqrt(np.maximum(J, 0.0) / np.diag(full.J))
        return np.array([k for k in self.allowed.tolist() if left[k] > TESTABLE], dtype=np.int64)

    @cached_property
    def prior(self) -> Prior:
        """Prior of the candidates at `use`."""
        first = len(self.evidence.weight)
        candidates = [self.evidence.candidates[k - first] for k in self.use.tolist()]
        J = self.evidence.information.given(self.evidence.model, self.evidence.weight).J[np.ix_(self.use, self.use)]
        return prior_of(
            candidates, [i for i, k in enumerate(self.use.tolist()) if k in self.finer], J, self.evidence.found
        )

    @cached_property
    def size(self) -> Floats:
        """One-sigma size of each candidate at `use`.

        Returns
        -------
        ndarray, shape (u,)
            SI.
        """
        return self.sizes_of(self.use)

    def sizes_of(self, columns: Ints) -> Floats:
        """One-sigma size of candidates that the data see at all.

        Parameters
        ----------
        columns : ndarray of int, shape (k,)
            Of the evidence.

        Returns
        -------
        ndarray, shape (k,)
            SI.
        """
        size = self.evidence.prior[columns - len(self.evidence.weight)].copy()
        J = np.diag(self.evidence.information.J)[columns]
        unknown = ~np.isfinite(size)
        size[unknown] = UNKNOWN_SIZE / np.sqrt(J[unknown])
        return np.asarray(size)

    @cached_property
    def keep(self) -> Ints:
        """Columns of the coefficients, then `use`.

        Returns
        -------
        ndarray of int, shape (p + u,)
        """
        return np.concatenate([self.evidence.model, self.use]).astype(np.int64)

    def in_noise(self, noise: NoiseModel) -> InNoise:
        """Information on coefficients and candidates in a noise."""
        if noise not in self._in_noise:
            as_stated = self.as_stated is self
            self._in_noise[noise] = self.worked_out(noise) if as_stated else self._in_excess(noise)
        return self._in_noise[noise]

    def _in_excess(self, noise: NoiseModel) -> InNoise:
        one, evidence = self.as_stated.in_noise(noise), self.evidence
        # What is known of the coefficients before the data does not change.
        pull = np.zeros(len(one.d))
        pull[: len(evidence.weight)] = evidence.weight * evidence.shift
        d = (one.d - pull) / self.excess + pull
        root = np.sqrt(self.excess)
        modes = Taken(one.modes.L / root, one.modes.Z / root, one.modes.z / root)
        return InNoise(one.J / self.excess, d, one.R, modes)

    def worked_out(self, noise: NoiseModel) -> InNoise:
        """Work out the information in a noise as its model states it."""
        keep, full = self.keep, self.evidence.information
        J, d = full.J[np.ix_(keep, keep)], full.d[keep]
        if not noise.terms or self.joint is None or self.wander is None:
            return InNoise(J, d, np.zeros((0, 0)), nothing_taken(len(keep)))
        modes = self.joint.taken(noise.terms, keep)
        return InNoise(J - modes.J, d - modes.d, root_of(noise.terms, self.wander.cut), modes)

    def data(self, noise: NoiseModel) -> tuple[float, Data]:
        """Log posterior of no effect in a noise, over that in white noise; and the candidates in it."""
        if noise not in self._data:
            evidence, p, one = self.evidence, len(self.evidence.weight), self.in_noise(noise)
            offset = noise.log_prior + self.likelihood(noise) / self.excess
            given = Information(one.J, one.d).given(np.arange(p), evidence.weight)
            scaled = np.ascontiguousarray(given.J[p:, p:] * np.outer(self.size, self.size))
            self._data[noise] = offset, Data(scaled, given.d[p:] * self.size, self.prior)
        return self._data[noise]

    def likelihood(self, noise: NoiseModel) -> float:
        """Log likelihood (1) of no effect in a noise, over that in white noise."""
        white, one = self.as_stated.in_noise(NoiseModel()), self.as_stated.in_noise(noise)
        return one.modes.gain + self._of_coefficients(one) - self._of_coefficients(white)

    def _of_coefficients(self, one: InNoise) -> float:
        """Log likelihood (1) that the coefficients add in a noise, but for what is the same in all."""
        weight = self.evidence.weight
        p = len(weight)
        return Information(one.J[:p, :p], one.d[:p]).log_likelihood(weight)

    def columns(self, members: Members) -> list[int]:
        """Columns of the evidence of the members of a model."""
        return [int(self.use[k]) for k, _ in members]

    def parameters(self, members: Members) -> tuple[Ints, Floats]:
        """Columns of the coefficients and of a model's members, and what is known of each before the data.

        Returns
        -------
        columns : ndarray of int, shape (p + k,)
        weight : ndarray, shape (p + k,)
            Prior information (1/SI^2).
        """
        known = np.concatenate([self.evidence.model, self.columns(members)]).astype(np.int64)
        own = [1.0 / (WIDTHS[width] * self.size[k]) ** 2 for k, width in members]
        return known, np.concatenate([self.evidence.weight, own])

    def noises(
        self, members: Members, tried: Sequence[NoiseTerm] | None = None, rival: float = -np.inf, brief: bool = False
    ) -> list[tuple[float, NoiseModel]]:
        """Noises that are probable beside a set of effects, each with the log posterior of both (1).

        Kinds that are `tried` alone are looked for; all without any. `rival` is the log posterior of the best model
        known. `brief` is that of `noise_search.explored`.
        """
        if self.joint is None or self.wander is None:
            return [(self.data(NoiseModel())[1].at(members).score, NoiseModel())]
        known, weight = self.parameters(members)
        information = self.joint.on_wander(known, weight)
        # A size that has the wrong sign in white noise may have the right one in another.
        alone = self.data(NoiseModel())[1].at(members).of_any_sign
        usual, behind = usual_sizes(self.evidence.imu), max(rival - alone, 0.0)
        found = explored(information, self.wander.cut, usual, tried, behind, brief)
        return [(alone + score, noise) for score, noise in found]

    def instead_of(self, likeliest: NoiseModel, others: Sequence[NoiseModel]) -> Sequence[NoiseModel]:
        """Noises in which an effect is seen that a term of the likeliest one stands for."""
        return instead_of(likeliest, others)

    def finer_variant(self, members: Members, place: int, noise: NoiseModel) -> Effect | None:
        """Make the scan finer about a member of a model; None where no variant gains as much as `_SHARPER`."""
        first = len(self.evidence.weight)
        number, _ = members[place]
        candidate = self.evidence.candidates[int(self.use[number]) - first]
        others = tuple(m for k, m in enumerate(members) if k != place)
        effect, name = candidate.effect, candidate.parameter.name
        begin = score = -np.inf
        while effect.nearer:
            variants = [variant.only((of_the_sensor(variant, name),)) for variant in effect.nearer()]
            gains = self._gains(variants, others, noise, float(self.size[number]))
            # The middle one is the candidate itself.
            begin = gains[len(variants) // 2] if np.isinf(begin) else begin
            score = float(np.max(gains))
            effect = variants[int(np.argmax(gains))]
        return effect if score > begin + _SHARPER else None

    def _gains(self, variants: Sequence[Effect], others: Members, noise: NoiseModel, size: float) -> Floats:
        """Log Bayes factor of each variant beside other members, by its better width; shape (variants,)."""
        p = len(self.evidence.weight)
        at = np.array([*range(p), *(p + k for k, _ in others)], dtype=np.int64)
        own, across, d = self.seen_of(self.evidence.signature(variants), at, noise)
        one, weight = self.in_noise(noise), self.parameters(others)[1]
        X = solved(one.J[np.ix_(at, at)] + np.diag(weight), np.column_stack([across.T, one.d[at]]))
        c = (own - np.einsum("ik,ki->i", across, X[:, :-1])) * size**2
        r = (d - across @ X[:, -1]) * size
        return np.asarray(gains(np.maximum(c, 0.0), r, np.zeros(len(c), dtype=bool)).max(axis=1))

    def seen_of(
        self, W: Floats, at: Ints, noise: NoiseModel, on_wander: Floats | None = None
    ) -> tuple[Floats, Floats, Floats]:
        """Say what the data hold of parameters that are no candidates, in a noise.

        Parameters
        ----------
        W : ndarray, shape (N, n)
            Their signatures (whitened residual per SI unit).
        at : ndarray of int, shape (k,)
            Places of other parameters in `in_noise`.
        on_wander : ndarray, shape (n, m), optional
            Information across them and the m errors of `wander`, where it is known (1/SI^2).

        Returns
        -------
        own : ndarray, shape (n,)
            Information on each (1/SI^2).
        across : ndarray, shape (n, k)
            Information across each and the others.
        d : ndarray, shape (n,)
            Pull of each (1/SI).
        """
        # The modes are as stated: an excess makes all smaller by the same factor.
        one, evidence = self.as_stated.in_noise(noise), self.evidence
        own, across, d = np.einsum("ij,ij->j", W, W), W.T @ evidence.W[:, self.keep[at]], W.T @ evidence.e
        if noise.terms and self.wander is not None:
            B = divided(one.modes.L, (self.wander.U.across(W) if on_wander is None else on_wander) @ one.R)
            own = own - np.einsum("ri,ri->i", B, B)
            across, d = across - B.T @ one.modes.Z[:, at], d - one.modes.z @ B
        return own / self.excess, across / self.excess, d / self.excess


def same_noise(one: NoiseModel, other: NoiseModel, ratio: float = 1.35) -> bool:
    """Whether two noises have the same terms, of sizes within a factor."""
    if one.key != other.key:
        return False
    return all(1.0 / ratio < size / other.sizes[kind] < ratio for kind, size in one.sizes.items())
