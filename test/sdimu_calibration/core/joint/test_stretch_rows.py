"""Rows of a recording with an error in each dwell: noise with a memory acts in turns alone."""

from __future__ import annotations

import numpy as np

from sdimu_calibration.core.estimation.noise_learning import in_noise
from sdimu_calibration.core.estimation.solve import solve
from sdimu_calibration.core.evidence.information import Information
from sdimu_calibration.core.evidence.noise_kernels import Stretches, kernel, stretches
from sdimu_calibration.core.joint.reduction import kept_and_others
from sdimu_calibration.core.joint.stretch_rows import stretch_rows
from sdimu_calibration.core.noise_term import FLICKER, RANDOM_WALK, NoiseTerm
from sdimu_calibration.storage.files.config import load_model

from .conftest import short, unit_set

GYRO = NoiseTerm("gyro", FLICKER, 0.0, 3e-6)
ACCEL = NoiseTerm("accel", RANDOM_WALK, 0.0, 2e-4, axes=(0, 2))


def test_turns_are_trusted_as_their_noise_allows_and_dwells_as_in_white_noise():
    """Against the covariance of all rows written out."""
    (member,) = unit_set(3, [short(stops=6)]).members
    fit = solve(member.open(), load_model("baseline"))
    evidence = fit.bare
    fit = in_noise(fit, (GYRO, ACCEL))
    rows, places = stretch_rows(fit)

    cut = stretches(evidence.times)
    assert cut.turning.any()
    U = evidence.constant_signature(cut).reshape(len(evidence.e), len(cut), 6)[:, cut.turning]
    both = np.ix_(cut.turning, cut.turning)
    S = np.eye(len(evidence.e))
    for term, first in ((GYRO, 0), (ACCEL, 3)):
        K = term.size**2 * kernel(term.kind, term.tau, cut)[both]
        for axis in term.axes:
            S += U[:, :, first + axis] @ K @ U[:, :, first + axis].T
    count = len(places)
    begin, end = np.array([stop[1:] for stop in evidence.times.stops]).T
    np.testing.assert_allclose(places.middle, 0.5 * (begin + end), rtol=1e-12)
    dwells = Stretches(begin, end, np.arange(count), np.zeros(count, dtype=bool))
    own = len(evidence.weight)
    W = np.hstack([evidence.W[:, :own], evidence.constant_signature(dwells)])
    kept, others = kept_and_others(evidence)
    d = W.T @ np.linalg.solve(S, evidence.e)
    d[others] += evidence.weight[others] * evidence.shift[others]
    expected = Information(W.T @ np.linalg.solve(S, W), d).given(others, evidence.weight[others])
    asked = np.concatenate([kept, np.arange(own, W.shape[1])])
    J = expected.J[np.ix_(asked, asked)]
    unit = 1.0 / np.sqrt(np.diag(J))
    np.testing.assert_allclose(rows.A.T @ rows.A * np.outer(unit, unit), J * np.outer(unit, unit), atol=1e-6)
    # The same recording that knows no such noise says more of what it turns through.
    white, _ = stretch_rows(fit.with_noise(None))
    scale = [k for k, name in enumerate(rows.names) if name.startswith("gyro_scale")]
    assert all(np.sum(white.A[:, k] ** 2) > 1.1 * np.sum(rows.A[:, k] ** 2) for k in scale)
