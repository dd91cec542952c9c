"""Noise with a memory as an IMU file states it, and as a calibration learned it: bias instability and random walk."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from sdimu_calibration.core.noise_term import FLICKER, MARKOV, RANDOM_WALK, TRIADS, NoiseTerm
from sdimu_calibration.core.specification import ImuSpecification

_FIELDS = {
    (triad, kind): f"{triad}_{name}"
    for triad in TRIADS
    for kind, name in ((FLICKER, "bias_instability"), (RANDOM_WALK, "random_walk"))
}
"""Field of a specification, by triad and kind of noise: the kinds that data sheets state, and no other."""
_FLICKER_OF_MARKOV = 0.437 * 2.0**0.5 / 0.664
"""Bias instability over the sigma of Markov noise that looks like it (1): the Allan deviation of one is .664 B, that of
the other .437 times its root of 2 at the most (IEEE Std 952-1997, annex C)."""


def stated_noise(imu: ImuSpecification) -> tuple[NoiseTerm, ...]:
    """List the noise with a memory that an IMU file states."""
    sizes = ((*term, getattr(imu, field)) for term, field in _FIELDS.items())
    return tuple(NoiseTerm(triad, kind, size=size) for triad, kind, size in sizes if size > 0.0)


def with_learned(imu: ImuSpecification, terms: Sequence[NoiseTerm]) -> ImuSpecification:
    """Return a specification that states the noise which a calibration learned.

    Of a triad with such noise it is all there is: what was stated was held against the same data. Of a triad without it
    what was stated stays, as it may lie below what the calibration sees.
    """
    learned = [found for term in terms if (found := _as_stated(term)) is not None]
    sizes: dict[str, Any] = {
        field: 0.0 for (triad, _), field in _FIELDS.items() if triad in {found.triad for found in learned}
    }
    for found in learned:
        field = _FIELDS[found.triad, found.kind]
        sizes[field] = float(np.hypot(sizes[field], found.size))
    return replace(imu, **sizes)


def not_stated(terms: Sequence[NoiseTerm]) -> list[str]:
    """Say which noise that a calibration learned no IMU file states, one line each."""
    held = "an IMU file states bias instability and random walk"
    return [f"{term.words} ({held})" for term in terms if _as_stated(term) is None]


def _as_stated(term: NoiseTerm) -> NoiseTerm | None:
    """Give a term as a kind that a file states; None where it is of no such kind, and looks like none."""
    if term.kind == MARKOV and FLICKER in term.alike:
        return replace(term, kind=FLICKER, tau=0.0, size=_FLICKER_OF_MARKOV * term.size)
    return term if (term.triad, term.kind) in _FIELDS else None
