"""Combinations of coefficients that a test does not determine, in words.

In units of the prior's sigmas the posterior covariance has eigenvalues between 0 (fully determined) and 1 (nothing
learnt). The eigenvectors near 1 are the unobservable combinations. A subspace has many bases; the one given here
starts with the rotations of the body frame, which have a name, and continues with combinations of few coefficients.

Source: Ham & Brown, "Observability, Eigenvalues, and Kalman Filtering", IEEE Trans. AES-19 (1983).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.effects.misalignment import ACCEL_MISALIGNMENT, GYRO_MISALIGNMENT

UNSEEN = 0.5
"""Share of the prior variance left from which a combination is unobservable: the data tell less than the prior."""
_MEMBER = 0.2
"""Least weight of a coefficient that is named, a share of the largest: smaller ones change the variance by 4 %."""
_CONTAINED = 0.9
"""Share of a named direction within the unobservable subspace from which it counts as unobservable: allows rounding."""

_AXES = "xyz"
_ROTATION = {
    axis: tuple(f"{effect.name}_{pair}" for effect in (GYRO_MISALIGNMENT, ACCEL_MISALIGNMENT) for pair in pairs)
    for axis, pairs in (("x", ("yx", "zx")), ("y", ("xy", "zy")), ("z", ("xz", "yz")))
}
"""Misalignments that a rotation of the body frame about an axis changes together, in both triads."""


@dataclass(frozen=True)
class Combination:
    """An unobservable combination."""

    text: str
    weights: tuple[tuple[str, float], ...]
    """Coefficients and weights, in units of their priors; empty for attitude."""
    left: float
    """Share of the prior variance that is left, 0 to 1."""


def unobservable(
    names: Sequence[str],
    prior: Floats,
    covariance: Floats,
    attitude_prior: Floats | None = None,
    attitude_sigma: Floats | None = None,
    C_nb: Floats | None = None,
) -> tuple[Combination, ...]:
    """Name what stays unobservable.

    Parameters
    ----------
    names : sequence of str, length p
    prior : ndarray, shape (p,)
        One-sigma before the test.
    covariance : ndarray, shape (p, p)
        After it, in the frame of the prior.
    attitude_prior, attitude_sigma : ndarray, shape (3,), optional
        Sigma of the initial attitude about N, E, D before and after (rad).
    C_nb : ndarray, shape (3, 3), optional
        Initial attitude, for the name of the body axis that was vertical.

    Returns
    -------
    tuple of Combination
        Rotations of the body frame first, then others, then azimuth.
    """
    scaled = covariance / np.outer(prior, prior)
    left, vectors = np.linalg.eigh(0.5 * (scaled + scaled.T))
    space = vectors[:, left > UNSEEN]
    found = []
    for axis in _AXES:
        direction = _rotation(names, prior, axis)
        if direction is None or np.linalg.norm(space.T @ direction) < _CONTAINED:
            continue
        meaning = f"rotation of the body frame about {axis}, a matter of definition"
        found.append(_named(names, direction, scaled, meaning))
        inside = space.T @ direction
        keep = np.eye(len(inside)) - np.outer(inside, inside) / (inside @ inside)
        space = _orthonormal(space @ keep)
    found += [_named(names, v, scaled, "") for v in _few_at_a_time(space)]
    if attitude_prior is not None and attitude_sigma is not None:
        share = float((attitude_sigma[2] / attitude_prior[2]) ** 2)
        if share > UNSEEN:
            found.append(Combination(_azimuth_words(C_nb), (), share))
    return tuple(found)


def _rotation(names: Sequence[str], prior: Floats, axis: str) -> Floats | None:
    """Direction of a body rotation in units of the prior, length 1; None when the model cannot follow it."""
    members = [names.index(n) for n in _ROTATION[axis] if n in names]
    if len(members) < len(_ROTATION[axis]):
        return None
    direction = np.zeros(len(names))
    direction[members] = 1.0 / prior[members]
    return np.asarray(direction / np.linalg.norm(direction))


def _few_at_a_time(space: Floats) -> list[Floats]:
    """Basis of a subspace (p, k) whose vectors have zeros where the others have their largest element."""
    k = space.shape[1]
    if k == 0:
        return []
    rows: list[int] = []
    rest = space.T.copy()
    for _ in range(k):
        pivot = int(np.argmax(np.sum(rest**2, axis=0)))
        rows.append(pivot)
        column = rest[:, pivot] / np.linalg.norm(rest[:, pivot])
        rest = rest - np.outer(column, column @ rest)
    basis = space @ np.linalg.inv(space[rows])
    return [v / np.linalg.norm(v) for v in basis.T]


def _named(names: Sequence[str], direction: Floats, scaled: Floats, meaning: str) -> Combination:
    size = np.abs(direction) / np.max(np.abs(direction))
    members = [i for i in np.argsort(-size, kind="stable") if size[i] > _MEMBER]
    if meaning:
        members.sort()
    weights = tuple((names[i], float(direction[i])) for i in members)
    left = float(direction @ scaled @ direction)
    if len(members) == 1:
        text = names[members[0]]
    else:
        sign = np.sign(direction[members[0]])
        parts = [f"{'with' if sign * direction[i] > 0 else 'against'} {names[i]}" for i in members[1:]]
        text = f"{names[members[0]]} {', '.join(parts)}"
    return Combination(f"{text}: {meaning}" if meaning else text, weights, left)


def _azimuth_words(C_nb: Floats | None) -> str:
    if C_nb is None:
        return "initial azimuth"
    axis = _AXES[int(np.argmax(np.abs(C_nb[2])))]
    return f"initial azimuth (rotation of the whole IMU about the vertical, body {axis} at the first stop)"


def _orthonormal(vectors: Floats) -> Floats:
    """Orthonormal basis of the columns' span, one dimension fewer than columns."""
    u, s, _ = np.linalg.svd(vectors, full_matrices=False)
    return np.asarray(u[:, s > 0.5])
