"""Coefficients sorted by the effect they belong to."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sdimu_calibration.core.arrays import Bools
from sdimu_calibration.core.effect_key import effect_of
from sdimu_calibration.core.results import Calibration

_FRAME_SHARE = 1e-6
"""A sigma below this share of the effect's largest is rounding: the body frame makes the coefficient zero."""


def groups(names: Sequence[str], model: Sequence[str]) -> dict[str, list[int]]:
    """Sort indices of coefficients by effect, both in the order of `names`."""
    found: dict[str, list[int]] = {}
    for index, name in enumerate(names):
        found.setdefault(effect_of(name, model), []).append(index)
    return found


def short_name(name: str, effect: str) -> str:
    """Cut the effect from a name: what tells it from others of the same effect, such as ``xy``."""
    return name.removeprefix(effect.partition("(")[0]).lstrip("_") or name.rpartition("_")[2]


def title(effect: str) -> str:
    """Write an effect name in words."""
    return effect.replace("_", " ")


def free(calibration: Calibration) -> Bools:
    """Tell estimated coefficients from those that the body frame makes zero by definition.

    Returns
    -------
    ndarray of bool, shape (p,)
    """
    sigma = np.sqrt(np.diag(calibration.covariance))
    out = np.zeros(len(sigma), dtype=bool)
    for own in groups(calibration.names, calibration.model).values():
        out[own] = sigma[own] > _FRAME_SHARE * sigma[own].max()
    return out
