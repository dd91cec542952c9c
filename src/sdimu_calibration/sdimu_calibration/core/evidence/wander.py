"""How wandering biases of the six sensors show in a test: signatures of a mean error in every stretch."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.evidence.in_stops import InStops
from sdimu_calibration.core.evidence.inner_noise import InnerNoise
from sdimu_calibration.core.evidence.linear import LinearEvidence
from sdimu_calibration.core.evidence.noise_kernels import Stretches, stretches
from sdimu_calibration.core.evidence.noise_root import root_of
from sdimu_calibration.core.noise_term import NoiseTerm

_SEEN = 5e-2
"""Ratio of the information on a mode to that of its prior below which it is left out: the data say nothing of it."""
_LOOKED_AT = 12
"""Number of stretches at rest of which the halves are compared: those of one test are much alike."""


@dataclass(frozen=True)
class Modes:
    """Independent modes of noise with a memory, r of unit variance."""

    columns: InStops
    """Signatures in the whitened residuals, N rows and r columns."""
    mean: Floats
    """What each mode adds to the mean error of each sensor over all dwells (SI), shape (6, r)."""
    unseen: Floats
    """Shape (6, 6). Covariance of these means by modes of which the data say nothing (SI). A bias of an accelerometer
    that the tilt takes up in most attitudes wanders there all the same."""


@dataclass(frozen=True)
class Wander:
    """How wandering biases of the six sensors would show in a test."""

    cut: Stretches
    """n cells."""
    U: InStops
    """Signatures, N rows and 6 n columns: column ``6 cell + channel``."""
    learned: tuple[NoiseTerm, ...] | None = None
    """Noise that the test asks for in these stretches, where their length hung on it; None where nobody looked."""
    inner: InnerNoise | None = None
    """In which U is whitened, and an evidence must be that goes with it."""
    plain: Wander | None = None
    """The same in white noise, where there is an `inner`."""
    halves: Floats = field(default_factory=lambda: np.zeros(6))
    """Information on the difference between the halves of a stretch at rest, in the middle of stretches (inverse
    squares of the units, SI), shape (6,). An accelerometer's mean error over a stretch is a tilt, and the data hardly
    show it; they show all of what changes within the stretch."""
    moved: Floats = field(default_factory=lambda: np.ones(6))
    """Mean square of the differences between the halves of stretches at rest, over that of white noise (1), shape (6,):
    it is one where nothing moves within a stretch."""
    _last: dict[Hashable, Modes] = field(default_factory=dict, init=False, repr=False, compare=False)
    """Modes of the noise that was asked for last: a fit is taken back to it again and again."""

    @property
    def in_white(self) -> Wander:
        """The same in white noise."""
        return self if self.plain is None else self.plain

    @classmethod
    def of(cls, evidence: LinearEvidence, share: float = 1.0) -> Wander:
        """Work out the signatures for the test of an evidence, in stretches of this share of the usual length."""
        cut = stretches(evidence.times, share)
        cut = replace(cut, conditions=evidence.conditions(cut))
        halves, moved = between_halves(evidence, cut)
        U = InStops.of(evidence.constant_signature(cut), evidence.stop)
        return cls(cut, U, inner=evidence.inner, halves=halves, moved=moved)

    def with_functions(self, evidence: LinearEvidence) -> Wander:
        """Return the same with functions of the attitude behind its stretches; itself where nobody knows that.

        Parameters
        ----------
        evidence : LinearEvidence
            N rows of the test, whitened as U is.
        """
        functions = evidence.attitude_functions()
        if functions is None or self.cut.functions is not None:
            return self
        # Roots that the stretches have worked out are shorter.
        cut = replace(self.cut, functions=functions, _modes={})
        return replace(self, cut=cut, U=self.U.beside(evidence.signature(functions.effects())))

    def modes(self, terms: Sequence[NoiseTerm]) -> Modes:
        """Work out independent modes of noise, those of which the data say nothing as a covariance of the means."""
        key = tuple((t.identity, t.size) for t in terms)
        if key not in self._last:
            self._last.clear()
            self._last[key] = self._modes(terms)
        return self._last[key]

    def _modes(self, terms: Sequence[NoiseTerm]) -> Modes:
        root = root_of(terms, self.cut)
        values, vectors = np.linalg.eigh(root.T @ self.U.square @ root)
        mean = np.einsum("s,scr->cr", self.cut.in_dwells, root.reshape(self.cut.cells, 6, -1)) @ vectors
        seen = values > _SEEN
        hidden = mean[:, ~seen]
        return Modes(self.U.combined(root @ vectors[:, seen]), mean[:, seen], hidden @ hidden.T)


def between_halves(evidence: LinearEvidence, cut: Stretches) -> tuple[Floats, Floats]:
    """Work out how well the data know the difference between the halves of a stretch at rest, and how large it is.

    Parameters
    ----------
    cut : Stretches
        Of the test; some of its rests, spread over the test, are looked at.

    Returns
    -------
    information : ndarray, shape (6,)
        On the difference for each sensor, the median of stretches (inverse squares of the units, SI); zero where the
        IMU never rests.
    moved : ndarray, shape (6,)
        Mean square of the differences over that of white noise (1); one where the IMU never rests.
    """
    rests = np.flatnonzero(~cut.turning)
    if not len(rests):
        return np.zeros(6), np.ones(6)
    some = rests[np.unique(np.linspace(0, len(rests) - 1, min(len(rests), _LOOKED_AT)).round().astype(int))]
    middle = 0.5 * (cut.start[some] + cut.end[some])
    start = np.column_stack([cut.start[some], middle]).ravel()
    end = np.column_stack([middle, cut.end[some]]).ravel()
    halves = Stretches(start, end, np.repeat(cut.interval[some], 2), np.zeros(len(start), dtype=bool))
    U = evidence.constant_signature(halves).reshape(-1, len(some), 2, 6)
    change = 0.5 * (U[:, :, 1] - U[:, :, 0])
    information = np.einsum("nsc,nsc->sc", change, change)
    pull = np.einsum("nsc,n->sc", change, evidence.e)
    seen = information > 0.0
    moved = np.where(seen, pull**2 / np.where(seen, information, 1.0), 1.0)
    return np.asarray(np.median(information, axis=0)), np.asarray(moved.mean(axis=0))
