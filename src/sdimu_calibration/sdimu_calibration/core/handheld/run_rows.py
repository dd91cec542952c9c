"""The equations of a finished fit of a run by hand, for recordings that learn their scatter together."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.handheld.handheld_data import HandheldRun
from sdimu_calibration.core.handheld.handheld_fit import (
    OTHER_PRIORS,
    FitPriors,
    LinearisationPoint,
    equations,
    scatter_of,
)
from sdimu_calibration.core.handheld.run_scatter import RunScatter


@dataclass(frozen=True)
class RunRows:
    """Equations ``residual + own s + shared (c - point) = noise``, with the priors of what is the run's own."""

    names: tuple[str, ...]
    """Coefficients c, length q."""
    own: Floats
    """Change of each residual (SI) per unit of each attitude and of the Earth's rate, shape (m, u)."""
    shared: Floats
    """Change of each residual (SI) per SI unit of each coefficient, shape (m, q)."""
    residual: Floats
    """Shape (m,). SI."""
    point: Floats
    """Coefficients at which the residuals are (SI), shape (q,)."""
    scatter: RunScatter
    extra: Floats
    """Sigmas beyond white noise in which the run was fitted, as of `RunScatter.sigmas`, shape (3,)."""


def run_rows(run: HandheldRun, scene: FitPriors, point: LinearisationPoint) -> RunRows:
    """Make the equations about the point where a fit ended."""
    k, q = len(run.t), len(scene.kept)
    rows, residual = equations(run, scene, point)
    scatter = scatter_of(run, scene)
    # The priors of the coefficients are those of the set.
    behind = len(rows) - OTHER_PRIORS
    kept = np.delete(np.arange(len(rows)), slice(behind - q, behind))
    return RunRows(
        tuple(scene.model.names[i] for i in scene.kept),
        np.hstack([rows[kept, : 3 * k], rows[kept, -3:]]),
        rows[kept, 3 * k : 3 * k + q],
        residual[kept],
        point.coefficients[scene.kept],
        scatter.of(kept),
        point.extra,
    )
