"""What one recording says in each noise that it may have: white, or with a memory of any kind that is probable.

Noise that a recording learns by itself may be what an effect leaves, and an effect that it shows may be noise; the
other recordings of the set tell. So a search in a set weighs the noises of every recording beside the effects.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from sdimu_calibration.core.arrays import Floats, Ints
from sdimu_calibration.core.evidence.information import Information, solved
from sdimu_calibration.core.evidence.joint_information import Joint
from sdimu_calibration.core.evidence.linear import LinearEvidence
from sdimu_calibration.core.evidence.taken import nothing_taken
from sdimu_calibration.core.evidence.wander import Wander
from sdimu_calibration.core.joint.reduction import Reduction, kept_and_others
from sdimu_calibration.core.noise_term import ATTITUDE
from sdimu_calibration.core.posterior.board import Board, same_noise
from sdimu_calibration.core.posterior.noise_models import NoiseModel
from sdimu_calibration.core.posterior.posterior import noises_of

_MOST = 12
"""Number of noises of a recording at most, those beside its best effects first: each costs a matrix of all candidates,
and the others weigh less than a hundredth."""


@dataclass(frozen=True)
class InOneNoise:
    """What a recording says in one noise.

    The log likelihood is ``-1/2 log_det - 1/2 (squares - explained - 2 d' theta + theta' J theta)``.
    """

    noise: NoiseModel
    names: tuple[str, ...]
    """Coefficients and candidates, length m."""
    columns: Ints
    """Shape (m,). Column of J and d of each name; two names may have one."""
    J: Floats
    """Inverse squares of the units (SI), shape (k, k)."""
    d: Floats
    """With all parameters at zero, shape (k,)."""
    explained: float
    log_det: float
    """`explained`, `log_det`: share of the sum of squares that the noise takes with all parameters at zero, and log of
    its determinant (1); up to what all noises of the recording have in common."""
    squares: float
    """Sum of squares in white noise (1)."""
    rows: int
    """Number of measurements."""

    def places(self, place: Mapping[str, int]) -> tuple[Ints, Ints]:
        """Places of parameters that are wanted of it, and the columns of J and d that hold them.

        Parameters
        ----------
        place : mapping of str to int
            Where each parameter that is wanted stands.

        Returns
        -------
        at, columns : ndarray of int, shape (w,)
        """
        have = [k for k, name in enumerate(self.names) if name in place]
        return np.array([place[self.names[k]] for k in have], dtype=np.int64), self.columns[have]


def in_its_noise(reduction: Reduction) -> InOneNoise:
    """Give what a recording says in the noise in which it was reduced."""
    A, y = reduction.A, reduction.y
    names = (*reduction.names, *reduction.labels)
    squares = float(y @ y) + reduction.unexplained
    return InOneNoise(NoiseModel(), names, np.arange(len(names)), A.T @ A, A.T @ y, 0.0, 0.0, squares, reduction.rows)


def rival_noises(evidence: LinearEvidence, wander: Wander, functions: Sequence[str] = ()) -> tuple[InOneNoise, ...]:
    """Work out the noises that a recording leaves probable, and what it says in each.

    Parameters
    ----------
    evidence : LinearEvidence
        In white noise, with the candidates of the set.
    wander : Wander
        As of `wander_in` for the noise of its fit, which sets the length of the stretches.
    functions : sequence of str
        Sensors that may have a function of the attitude beside the noise: theirs is no noise besides.
    """
    evidence = evidence.in_inner(wander.inner)
    board = Board(evidence, np.arange(len(evidence.weight), len(evidence.names)), frozenset(), wander)
    noises = [NoiseModel()]
    for noise in (_without_functions(noise, functions) for noise in noises_of(board)):
        if len(noises) < _MOST and not any(same_noise(noise, other) for other in noises):
            noises.append(noise)
    joint = board.joint or Joint.of(evidence, wander)
    return tuple(_in_one(joint, noise) for noise in noises)


def _without_functions(noise: NoiseModel, sensors: Sequence[str]) -> NoiseModel:
    """Leave out of a noise what follows the attitude in some sensors: one cause would stand in a model twice."""
    kept = [
        (term, share)
        for term, share in zip(noise.terms, noise.shares, strict=True)
        if term.kind != ATTITUDE or term.sensors.isdisjoint(sensors)
    ]
    return NoiseModel(tuple(term for term, _ in kept), tuple(share for _, share in kept))


def _in_one(joint: Joint, noise: NoiseModel) -> InOneNoise:
    evidence, own = joint.evidence, len(joint.evidence.weight)
    kept, others = kept_and_others(evidence)
    order = np.concatenate([kept, np.arange(own, len(evidence.names))])
    modes = joint.taken(noise.terms) if noise.terms else nothing_taken(len(evidence.names))
    full = evidence.information
    full = Information(full.J - modes.J, full.d - modes.d)
    # Log determinant of the noise over white noise, and the sum of squares that it takes at the calibration.
    log_det, explained = 2.0 * float(np.log(np.diag(modes.L)).sum()), float(modes.z @ modes.z)
    J, d = full.J[np.ix_(order, order)], full.d[order].copy()
    d[: len(kept)] -= evidence.weight[kept] * evidence.shift[kept]
    if len(others):
        A, B = full.J[np.ix_(others, others)] + np.diag(evidence.weight[others]), full.J[np.ix_(order, others)]
        X = solved(A, np.column_stack([B.T, full.d[others]]))
        J, d = J - B @ X[:, :-1], d - B @ X[:, -1]
        explained += float(full.d[others] @ X[:, -1])
        log_det += float(np.linalg.slogdet(A)[1])
    # From the calibration to all parameters at zero.
    point = np.zeros(len(order))
    point[: len(kept)] = -evidence.shift[kept]
    explained -= float(2.0 * d @ point + point @ J @ point)
    names = tuple(evidence.names[k] for k in order)
    squares, rows = float(evidence.e @ evidence.e), len(evidence.e)
    return InOneNoise(noise, names, np.arange(len(names)), J, d + J @ point, explained, log_det, squares, rows)
