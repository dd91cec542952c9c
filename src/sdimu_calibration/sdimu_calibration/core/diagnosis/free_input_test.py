"""Is anything left that no candidate explains? Every dwell and every turn gets a sensor error of its own."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sdimu_calibration.core.arrays import Floats, Ints
from sdimu_calibration.core.evidence.information import Information
from sdimu_calibration.core.probability import chi2_tail

_TESTABLE = 1e-2
"""Share of the information on a direction that the model must leave for it to be tested: with less, the model makes its
sigma more than ten times larger."""


@dataclass(frozen=True)
class FreeInputTest:
    """Free-input test."""

    chi2: float
    """Fall of chi-square when every segment has its own constant sensor error."""
    dof: int
    p_value: float
    estimate: Floats
    """The missing sensor error of each segment and sensor that fits best (minimum norm), SI, shape (f,)."""
    z: Floats
    """Score of each alone, shape (f,)."""


def free_input_test(full: Information, known: Ints, weight: Floats, free: Ints) -> FreeInputTest:
    """Test whether a constant sensor error of its own in every dwell and turn explains more than chance.

    Parameters
    ----------
    full : Information
        On all columns of an evidence.
    known : ndarray of int, shape (k,)
        Columns of the model and of what was added to it.
    weight : ndarray, shape (k,)
        Prior information of each (1/sigma^2, SI).
    free : ndarray of int, shape (f,)
        Columns of the free inputs.

    Returns
    -------
    FreeInputTest
        Its p-value is 1 where nothing is testable.
    """
    given = full.given(known, weight)
    J, d = given.J[np.ix_(free, free)], given.d[free]
    unit = 1.0 / np.sqrt(np.maximum(np.diag(full.J)[free], 1e-300))
    values, vectors = np.linalg.eigh(J * np.outer(unit, unit))
    keep = values > _TESTABLE
    y = vectors[:, keep].T @ (unit * d)
    fall = float(np.sum(y**2 / values[keep]))
    estimate = unit * (vectors[:, keep] @ (y / values[keep]))
    with np.errstate(divide="ignore", invalid="ignore"):
        own = np.diag(J)
        z = np.where(own > (0.02 / unit) ** 2, d / np.sqrt(own), 0.0)
    dof = int(keep.sum())
    return FreeInputTest(fall, dof, chi2_tail(fall, dof) if dof else 1.0, estimate, np.nan_to_num(z))
