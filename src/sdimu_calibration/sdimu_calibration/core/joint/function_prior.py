"""The sizes that a function of the attitude may have, each a part of a model beside noise and effects.

The function may be common to all recordings of a set, or of one recording alone. The evidence of a set holds the
weights of the common one with the prior of its fit. In another size they are known better or less well before the
data: information on them is added, about their estimate, and the determinant of the prior is another one. The weights
of a recording's own function add to these; they are integrated in what that recording says.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from sdimu_calibration.core.arrays import Floats, Ints
from sdimu_calibration.core.joint.set_evidence import SetEvidence
from sdimu_calibration.core.joint.shared_function import SharedFunction
from sdimu_calibration.core.noise_term import ATTITUDE, TRIADS, NoiseTerm
from sdimu_calibration.core.posterior.noise_models import ODDS, SENSORS, Sizes

_STEPS = np.arange(-10.0, 5.0)
"""Powers of `_RATIO` by which sizes differ from that of the fit (1). Up: what is told falsely takes most of a function.
Down: where recordings have functions of their own, one that they must share is larger by a factor of hundreds."""
_RATIO = 2.0
"""Ratio of neighbouring sizes (1): of a hundred weights the size is known to a tenth, of ten to a third."""
_NONE = 1e-3
"""Ratio of a size that is as good as none to that of the fit (1): a millionth of its variance."""
OF_FIT = 1 + int(np.flatnonzero(_STEPS == 0.0)[0])
"""Place of the size of the fit among those of a sensor (1): the first is none."""


@dataclass(frozen=True)
class Change:
    """What another size changes of what is known of the weights."""

    columns: Ints
    """Of the evidence, shape (m,)."""
    more: Floats
    """Information beyond that of the fit (1/SI^2), shape (m,)."""
    values: Floats
    """The weights in the fit (SI), shape (m,)."""
    log_det: float
    """Of their prior covariance over that of the fit (1)."""


@dataclass(frozen=True)
class OwnWeights:
    """Weights of a function that one recording has for itself."""

    labels: tuple[str, ...]
    """Names of the common weights to which they add, length m."""
    size: Floats
    """One-sigma of each (SI), shape (m,)."""


class FunctionPrior:
    """Sizes of the function of each sensor: none first.

    Parameters
    ----------
    shared : SharedFunction or None
        Without one there are no sizes.
    evidence : SetEvidence
        With the weights in its model.
    usual : Sizes
        Of the functions of an IMU.
    """

    def __init__(self, shared: SharedFunction | None, evidence: SetEvidence, usual: Sizes) -> None:
        self._columns: list[Ints] = []
        self._labels: list[tuple[str, ...]] = []
        self._evidence = evidence
        self.sizes: list[Floats] = []
        self._shares: list[Floats] = []
        self._triads: list[str] = []
        self.sensors = () if shared is None else shared.sensors
        place = {name: k for k, name in enumerate(evidence.names[: len(evidence.weight)])}
        labels = [] if shared is None else [(s, np.array(shared.labels)[shared.of(s)].tolist()) for s in shared.sensors]
        for sensor, own in labels:
            at = np.array([place[label] for label in own], dtype=np.int64)
            size = float(evidence.weight[at[0]]) ** -0.5
            tried = size * np.concatenate([[_NONE], _RATIO**_STEPS])
            term = NoiseTerm(next(t for t in TRIADS if sensor.startswith(t)), ATTITUDE)
            share = np.log(np.log(_RATIO)) + usual.log_density(term, tried)
            share[0] = 0.0
            self._triads.append(term.triad)
            self._columns.append(at)
            self._labels.append(tuple(own))
            self.sizes.append(tried)
            self._shares.append(share)

    @property
    def counts(self) -> tuple[int, ...]:
        """Number of sizes of each sensor, none among them."""
        return tuple(map(len, self.sizes))

    def log_prior(self, chosen: Sequence[int]) -> float:
        """Log of the odds of a function in some sizes beside none (1), whether common or of one recording."""
        sizes = float(sum(share[k] for share, k in zip(self._shares, chosen, strict=True)))
        # The odds of a triad are shared by the choices of its sensors, as those of a single recording are.
        having = {triad for triad, k in zip(self._triads, chosen, strict=True) if k}
        return sizes + len(having) * float(np.log(ODDS[ATTITUDE] / len(SENSORS)))

    def change(self, chosen: Sequence[int]) -> Change:
        """Give what some sizes change of what is known of the common weights."""
        fitted = [self._evidence.weight[at] for at in self._columns]
        known = [
            np.full(len(at), sizes[k] ** -2.0) for at, sizes, k in zip(self._columns, self.sizes, chosen, strict=True)
        ]
        columns = np.concatenate([np.zeros(0, dtype=np.int64), *self._columns])
        before, after = np.concatenate([np.zeros(0), *fitted]), np.concatenate([np.zeros(0), *known])
        log_det = float(np.sum(np.log(before / after)))
        return Change(columns, after - before, -self._evidence.shift[columns], log_det)

    def own(self, chosen: Sequence[int]) -> OwnWeights:
        """Give the weights of a recording's own function in some sizes; none where all are none."""
        having = [k for k, size in enumerate(chosen) if size]
        labels = tuple(label for k in having for label in self._labels[k])
        sizes = [np.full(len(self._labels[k]), self.sizes[k][chosen[k]]) for k in having]
        return OwnWeights(labels, np.concatenate([np.zeros(0), *sizes]))

    def nearest(self, size: Mapping[str, float]) -> tuple[int, ...]:
        """Find the sizes nearest to some (SI), by sensor."""
        pairs = zip(self.sensors, self.sizes, strict=True)
        return tuple(int(np.argmin(np.abs(np.log(sizes / size[sensor])))) for sensor, sizes in pairs)
