"""Missing physics: the bias that a test states is the mean over its dwells, what adds to it included."""

from __future__ import annotations

import numpy as np
import pytest

from sdimu_calibration.core.recording import PhaseLog, Recording
from sdimu_sim.core.truth import ImuTruth
from sdimu_study import many, missing
from sdimu_study.missing import with_mean_error


def test_a_transient_counts_with_its_mean_over_the_dwells_alone():
    t = np.arange(1, 1001) * 0.1
    rng = np.random.default_rng(2)
    omega, force = rng.standard_normal((2, 1000, 3))
    log = PhaseLog(np.array([0.0, 40.0, 60.0]), np.array([True, False, True]), np.array([0, 0, 1]))
    clean = Recording(0, t, omega, force, phase=log)
    added = np.where(t > 60.0, 2e-3, 0.0) + np.where((t > 40.0) & (t <= 60.0), 7.0, 0.0)
    disturbed = Recording(0, t, omega + np.outer(added, [0.0, 1.0, 0.0]), force, phase=log)
    found = with_mean_error(ImuTruth(coefficients={"gyro_bias_y": 1e-3, "accel_bias_z": 4.0}), clean, disturbed)
    # Forty seconds of eighty at rest; what the turn adds is no bias.
    assert found.coefficients["gyro_bias_y"] == pytest.approx(1e-3 + 1e-3)
    assert found.coefficients["accel_bias_z"] == 4.0
    assert found.coefficients["gyro_bias_x"] == 0.0


@pytest.mark.slow
def test_a_transient_that_the_catalogue_lacks_is_seen_and_its_sigmas_hold():
    rows = [missing.STUDY.of(("dtg", "gyro_bias_settling"))(seed) for seed in (21, 22, 23)]
    assert all(row["without"]["verdict"] != "consistent" for row in rows)
    assert sum(bool(row["with"]["in_class"]) for row in rows) >= 2


@pytest.mark.slow
def test_many_effects_at_once_are_scored_by_name():
    row = many.STUDY.of(("dtg",))(31)
    large = [effect for effect in row["effects"] if effect["sigmas"] > 8.0]
    assert large
    assert sum(effect["named"] for effect in large) >= 0.8 * len(large)
    assert len(row["wrong"]) <= 1
