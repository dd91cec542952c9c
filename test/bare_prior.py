"""Prior of candidates without effects behind them, for tests of the posterior."""

from __future__ import annotations

import numpy as np

from sdimu_calibration.core.posterior.prior import Prior


def prior(q: int, **changes) -> Prior:
    """Candidates that have nothing to do with each other, the first two but for their cause."""
    usual = np.log(np.linspace(1.0, 2.0, q) / np.linspace(1.0, 2.0, q).sum())
    kept = {
        "log_share": usual,
        "cause": np.array([0, 0, *range(1, q - 1)]),
        "parameter": np.arange(q),
        "repeats": np.zeros(q, dtype=bool),
        "positive": np.zeros(q, dtype=bool),
        "own": np.zeros(q, dtype=bool),
        "drift": np.full(q, -1),
        "twin": np.arange(q),
    }
    return Prior(**(kept | changes))
