"""Two mistakes that make discoveries of noise: put back, each shows in the scores of clean data."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sdimu_calibration.core.diagnosis.scan import scan
from sdimu_calibration.core.effects import registry
from sdimu_calibration.core.estimation.solve import solve
from sdimu_calibration.core.evidence.navigation_evidence import columns
from sdimu_calibration.core.navigation.track import Correction, motion

SEEDS = (101, 102, 103)
_DRIFTS = ("gyro_bias_ramp", "gyro_g_squared", "gyro_g_sensitivity", "gyro_magnetic")


def _scores(evidence):
    scanned = scan(evidence.information, evidence.model, evidence.weight)
    return scanned.z[np.isfinite(scanned.sigma)]


def _evidence(fit, names):
    return fit.evidence([registry.get(name) for name in names])


def test_regressors_of_measured_motion_make_a_dead_band_of_noise(bench):
    # The sign of a rate near nought is the sign of its own noise: noise correlates with what it is compared with.
    right, wrong = [], []
    for seed in SEEDS:
        fit = bench.fit(seed=seed)
        setup, effect = fit.setup, registry.get("gyro_dead_band")
        evidence = _evidence(fit, ["gyro_dead_band"])
        measured = motion(
            fit.prepared.cycles,
            fit.prepared.rest,
            Correction(setup.sensors, fit.estimate),
            fit.last.C_start.copy(),
            setup.around(None),
            predicted=False,
        )
        p = len(evidence.weight)
        noisy = columns(fit.prepared, replace(evidence.known, seen=measured), evidence.latitude, [effect])
        right.append(_scores(evidence))
        wrong.append(_scores(replace(evidence, W=np.hstack([evidence.W[:, :p], noisy]))))
    # Nine normal scores have a root mean square below 2 but for a chance of 1e-4.
    assert np.sqrt(np.mean(np.square(right))) < 2.0
    assert np.sqrt(np.mean(np.square(wrong))) > 2.0


def test_a_filter_that_forgets_shared_noise_inflates_the_scores_of_gyro_drifts(bench):
    # Zw and Zf reuse the samples that drive the navigation. The same data through both filters: chance cancels.
    right, wrong = [], []
    for seed in SEEDS:
        fit = bench.fit(seed=seed)
        forgetful = solve(fit.test, replace(bench.model, shared_noise=False))
        right.append(_scores(_evidence(fit, _DRIFTS)))
        wrong.append(_scores(_evidence(forgetful, _DRIFTS)))
    ratio = np.sqrt(np.mean(np.square(np.concatenate(wrong))) / np.mean(np.square(np.concatenate(right))))
    # Design study: 1.5 with measurements every second. Seen here before the bound was set: 1.26 to 1.49 on four seeds.
    assert ratio > 1.1
