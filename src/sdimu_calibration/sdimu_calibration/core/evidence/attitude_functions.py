"""An unknown smooth function of the attitude, as a sum of functions that every sample sees where it is.

The mean over a stretch is no such function where the IMU turns within it. Exact are m functions of the direction u of
the specific force,

    phi(u) = k(u, Z) L'^-1,   LL' = k(Z, Z),

whose sum with independent weights of unit variance has the covariance ``k(u, Z) k(Z, Z)^-1 k(Z, v)``: that of a
Gaussian process seen through its values at knots Z, which are taken where the test has been.

Sources: C. Rasmussen, C. Williams, "Gaussian Processes for Machine Learning" (2006), section 8.3 (subset of
regressors); S. Fine, K. Scheinberg, "Efficient SVM training using low-rank kernel representations", J. Mach. Learn.
Res. 2 (2001) (knots by incomplete Cholesky decomposition).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.effects.effect import CHANNELS, Effect, Parameter, Term
from sdimu_calibration.core.effects.motion import Motion
from sdimu_calibration.core.evidence.conditions import alike_attitudes

_LEFT = 1e-3
"""Variance of the function (1) that the knots may leave anywhere: a thirtieth of its size."""
MOST = 90
"""Number of knots at most: kim18, kim18_signed and recommended take 84 to 88, the whole sphere 222."""
_PLACES = 3000
"""Number of directions (1) among which knots are looked for: a turn of half a circle is cut into parts of 2 deg."""
_BLOCK = 10
"""Number of functions (1) of an effect: the signatures of several effects are worked out side by side."""
_ROUNDING = 1e-10
"""Share of the variance (1) that is added to that of each knot: far below what the knots may leave."""


@dataclass(frozen=True)
class AttitudeFunctions:
    """Functions of the attitude, m of them."""

    knots: Floats
    """Directions of force in b (1), shape (m, 3)."""

    def __len__(self) -> int:
        """Return the number of functions."""
        return len(self.knots)

    def at(self, direction: Floats) -> Floats:
        """Evaluate the functions.

        Parameters
        ----------
        direction : ndarray, shape (n, 3)
            Of the specific force in b (1).

        Returns
        -------
        ndarray, shape (n, m)
            (1).
        """
        square = alike_attitudes(self.knots, self.knots) + _ROUNDING * np.eye(len(self))
        return np.asarray(np.linalg.solve(np.linalg.cholesky(square), alike_attitudes(self.knots, direction)).T)

    def effects(self) -> list[Effect]:
        """Give every sensor an error that is a sum of the functions; six parameters a function, in their order."""
        last: list[tuple[Motion, Floats]] = []

        def at(motion: Motion) -> Floats:
            if not last or last[0][0] is not motion:
                # All effects are asked about one motion, one after the other.
                last[:] = [(motion, self.at(directions(motion)))]
            return last[0][1]

        return [self._effect(range(k, min(k + _BLOCK, len(self))), at) for k in range(0, len(self), _BLOCK)]

    def _effect(self, numbers: range, at: Callable[[Motion], Floats]) -> Effect:
        units = [("rad/s", "deg/h") if k < 3 else ("m/s^2", "ug") for k in range(len(CHANNELS))]
        label = f"functions of the attitude from {numbers.start}"
        count = len(numbers) * len(CHANNELS)

        def values(motion: Motion) -> Floats:
            return at(motion)[:, numbers.start : numbers.stop].repeat(len(CHANNELS), axis=1)

        return Effect(
            name=label,
            title=label,
            equation="phi(u)",
            parameters=tuple(
                Parameter(f"{c} function {n}", *unit) for n in numbers for c, unit in zip(CHANNELS, units, strict=True)
            ),
            terms=tuple(Term(k % len(CHANNELS), k) for k in range(count)),
            regressors=values,
            prior={},
        )


def attitude_functions(seen: Motion, dwells: Sequence[tuple[float, float]]) -> AttitudeFunctions:
    """Choose the functions for a test.

    Parameters
    ----------
    seen : Motion
        n cycles.
    dwells : sequence of (float, float)
        Start and end of each dwell (s): knots are there first, as most of a test is.
    """
    every = directions(seen)
    middle = seen.t - 0.5 * seen.dt
    rests = [every[(middle >= begin) & (middle <= end)].mean(axis=0) for begin, end in dwells]
    first = np.array(rests) / np.linalg.norm(rests, axis=1)[:, None]
    return covering(first, way(seen))


def covering(first: Floats, path: Floats, most: int = MOST) -> AttitudeFunctions:
    """Choose functions that make up any smooth function at all places.

    Parameters
    ----------
    first, path : ndarray, shapes (d, 3), (n, 3)
        Directions of force in b (1): those where knots are first, and all others.
    most : int
        Number of functions at most.
    """
    return AttitudeFunctions(np.vstack([first, path])[_knots(first, path, most)])


def way(seen: Motion) -> Floats:
    """Thin out the directions of force of a test, in b.

    Returns
    -------
    ndarray, shape (k, 3)
        (1).
    """
    return directions(seen)[:: max(1, len(seen.t) // _PLACES)]


def directions(motion: Motion) -> Floats:
    """Direction of the specific force in b.

    Returns
    -------
    ndarray, shape (n, 3)
        (1).
    """
    return np.asarray(motion.f / np.linalg.norm(motion.f, axis=1)[:, None])


def _knots(first: Floats, path: Floats, most: int) -> list[int]:
    """Numbers of the knots among `first` (d, 3), then among `path` (n, 3), each where most is left by those before."""
    places = np.vstack([first, path])
    left, root = np.ones(len(places)), np.zeros((len(places), 0))
    knots: list[int] = []
    for among in (slice(0, len(first)), slice(0, len(places))):
        while len(knots) < most and left[among].max() > _LEFT:
            knot = int(np.argmax(left[among]))
            column = alike_attitudes(places, places[[knot]])[:, 0] - root @ root[knot]
            column /= np.sqrt(left[knot])
            root = np.column_stack([root, column])
            left = np.maximum(left - column**2, 0.0)
            knots.append(knot)
    return knots
