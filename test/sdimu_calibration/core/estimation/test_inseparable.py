"""Coefficients that a test does not tell from each other are named."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sdimu_calibration.api.fit import CalibrationFit
from sdimu_calibration.api.functions import diagnose
from sdimu_calibration.core.estimation.outcome import inseparable, outcome
from sdimu_calibration.core.estimation.solve import extend
from sdimu_calibration.core.evidence.noise_kernels import constant_between
from sdimu_calibration.storage.files.effect_file import find_effects


def test_a_second_bias_is_told_with_the_one_it_is(bench):
    prior = dict.fromkeys(["navigation", "tactical", "mems"], 1e-5)
    always = replace(constant_between("the test", -1.0, 1e9), prior=prior).only(("gyro_x in the test",))
    wider = outcome(extend(bench.fit(), [always]))
    assert any(w.startswith("gyro_bias_x and gyro_x in the test cannot be told") for w in wider.warnings)
    assert not any("cannot be told" in w for w in outcome(bench.fit()).warnings)


def test_coefficients_without_variance_are_not_compared():
    covariance = np.array([[0.0, 0.0, 0.0], [0.0, 4.0, -1.0], [0.0, -1.0, 1.0]])
    assert inseparable(("a", "b", "c"), covariance) == []
    covariance[1, 2] = covariance[2, 1] = -1.9999
    (line,) = inseparable(("a", "b", "c"), covariance)
    assert line.startswith("b and c cannot be told from each other")


def test_a_fit_and_a_diagnosis_in_python_show_the_pair(bench):
    fit = CalibrationFit(bench.fit()).add("gyro_x: 1")
    assert "gyro_bias_x and gyro_x: 1 cannot be told" in repr(fit)
    assert "gyro_bias_x and gyro_x: 1 cannot be told" in repr(diagnose(fit))


def test_a_sum_of_coefficients_is_told_with_each_of_them(bench):
    """Drift by the force along two axes at once: the model has a coefficient for each."""
    wider = outcome(extend(bench.fit(), find_effects("gyro_x: ax + ay")), held_out=False)
    told = " ".join(w for w in wider.inseparable if "gyro_x: ax + ay" in w)
    assert {"gyro_mass_unbalance_dx", "gyro_mass_unbalance_qx"} <= set(told.split())
