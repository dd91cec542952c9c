"""How well coefficients that a fit in white noise takes from a part of a test hold in another stretch of it.

In noise with a memory they hold less well than in white noise: the wander of the biases bends the fit, and the biases
of the stretch are not those of the part. Both follow from the same wander u, with signatures U and covariance K
(`evidence.learned_noise`): least squares on the rows of the part are off by ``C W'U u``, the biases of the stretch by
their share ``S u``, so the covariance grows by ``(S - C W'U) K (S - C W'U)'``.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sdimu_calibration.core.arrays import Bools, Floats
from sdimu_calibration.core.effects import bias
from sdimu_calibration.core.evidence.information import solved
from sdimu_calibration.core.evidence.linear import LinearEvidence
from sdimu_calibration.core.evidence.noise_kernels import Stretches
from sdimu_calibration.core.evidence.noise_root import root_of
from sdimu_calibration.core.evidence.wander import Wander
from sdimu_calibration.core.noise_term import NoiseTerm

Span = tuple[float, float]
"""Begin and end (s)."""


def doubt_in_stretch(
    evidence: LinearEvidence, rows: Bools, wander: Wander, terms: Sequence[NoiseTerm], at: Span
) -> Floats:
    """Give the covariance that noise with a memory adds to coefficients by a part of a test, in a stretch of it.

    Parameters
    ----------
    evidence : LinearEvidence
        Of the whole test in white noise, N rows and q coefficients.
    rows : ndarray of bool, shape (N,)
        Those of the part.
    at : (float, float)
        The stretch; its biases are taken as constant over it.

    Returns
    -------
    ndarray, shape (q, q)
        SI.
    """
    q = len(evidence.weight)
    W = np.where(rows[:, None], evidence.W[:, :q], 0.0)
    R = root_of(terms, wander.cut)
    bent = solved(W.T @ W + np.diag(evidence.weight), wander.U.across(W) @ R)
    apart = _biases(evidence.names[:q], wander.cut, at) @ R - bent
    return np.asarray(apart @ apart.T)


def _biases(names: Sequence[str], cut: Stretches, at: Span) -> Floats:
    """Return the map from the mean errors of all stretches to the biases in a span of time, shape (q, 6 n)."""
    inside = np.clip(np.minimum(cut.end, at[1]) - np.maximum(cut.start, at[0]), 0.0, None)
    share = inside / inside.sum()
    out = np.zeros((len(names), len(cut), 6))
    for channel, name in enumerate(bias.NAMES):
        if name in names:
            out[names.index(name), :, channel] = share
    return out.reshape(len(names), -1)
