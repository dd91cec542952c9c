"""Variables of the motion on which an effect depends: found by changing them one at a time, not by a list of names."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import cache

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.effects.effect import Effect
from sdimu_calibration.core.effects.motion import NO_PAST, Motion

FIELDS = (
    "w",
    "f",
    "t",
    "temperature",
    "temperature_rate",
    "alpha",
    "w_table",
    "rest",
    "C_nb",
    "magnetic_n",
    "turned",
    "leant",
    "since_turn",
    "wound",
    "past",
)
_ROWS = 2000
"""Number of rows of the random motion: enough to cross the thresholds of effects."""
_SPAN_S = 20_000.0
"""Length of the random motion (s): longer than a test, so that steps and transients lie within."""


def reads(effect: Effect) -> frozenset[str]:
    """Names of the fields of `Motion` on which the regressors of an effect depend."""
    one, other = _two_motions()
    before = effect.regressors(one)
    return frozenset(
        name for name in FIELDS if not np.array_equal(effect.regressors(_changed(one, other, name)), before)
    )


@cache
def _two_motions() -> tuple[Motion, Motion]:
    """Two motions that differ in every variable, the same for all effects."""
    rng = np.random.default_rng(3)
    one, other = any_motion(rng), any_motion(rng)
    return one, replace(other, t=0.6 * one.t + 7.0, rest=~one.rest, past=_AnyMemory(-one.past["", 0.0]))


def _changed(one: Motion, other: Motion, name: str) -> Motion:
    return replace(one, **{name: getattr(other, name)})


def any_motion(rng: np.random.Generator) -> Motion:
    """Motion in which every variable goes its own way."""

    def any_of(*shape: int) -> Floats:
        return rng.normal(size=shape)

    n = _ROWS
    C_nb = np.linalg.qr(any_of(n, 3, 3))[0]
    return Motion(
        np.linspace(1.0, _SPAN_S, n),
        np.full(n, _SPAN_S / n),
        any_of(n, 3),
        10.0 * any_of(n, 3),
        C_nb,
        any_of(n, 3),
        any_of(n, 3),
        rng.random(n) < 0.5,
        10.0 * any_of(n),
        0.01 * any_of(n),
        np.sign(any_of(n, 3)),
        np.sign(any_of(n, 3)),
        100.0 * rng.random(n),
        1e-5 * any_of(3),
        any_of(n, 3),
        # Far beyond any force: play forgets all but the side from which it was drawn.
        _AnyMemory(1e3 * any_of(3)),
    )


class _AnyMemory(Mapping[tuple[str, float], Floats]):
    """The same for whatever an effect may ask for, y (3,) in g."""

    def __init__(self, y: Floats) -> None:
        self._y = y

    def __getitem__(self, _: tuple[str, float]) -> Floats:
        return self._y

    def __iter__(self) -> Iterator[tuple[str, float]]:
        return iter(())

    def __len__(self) -> int:
        return 0


def samples_motion(t: Floats, dt: Floats, w: Floats, f: Floats, heat: Floats, heat_rate: Floats) -> Motion:
    """Motion as far as samples alone determine it: attitude, table rate and angular acceleration are zero.

    Parameters
    ----------
    t, dt : ndarray, shape (n,)
        End and length of each sample's interval (s).
    w, f : ndarray, shape (n, 3)
        Body rate (rad/s) and specific force (m/s^2).
    heat, heat_rate : ndarray, shape (n,)
        Temperature above the one from which the coefficients count (K) and its rate (K/s).
    """
    n = len(t)
    none = np.broadcast_to(np.zeros(3), (n, 3))
    C_nb = np.broadcast_to(np.eye(3), (n, 3, 3))
    rest = np.zeros(n, dtype=np.bool_)
    never = np.full(n, np.inf)
    return Motion(t, dt, w, f, C_nb, none, none, rest, heat, heat_rate, none, none, never, np.zeros(3), none, NO_PAST)
