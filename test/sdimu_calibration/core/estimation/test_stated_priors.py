"""A model that states the prior of a coefficient: the fit is the one of all priors, conditioned on that one."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from sdimu_calibration.core.estimation.fit import Fit
from sdimu_calibration.core.estimation.prepared_test import PreparedTest
from sdimu_calibration.core.estimation.solve import solve
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.specification import StatedPrior
from sdimu_calibration.storage.files.config import load_model


@pytest.fixture(scope="module")
def prepared(bench: Any) -> PreparedTest:
    return PreparedTest(bench.recording(), bench.imu, bench.site)


@pytest.fixture(scope="module")
def free(prepared: PreparedTest) -> Fit:
    """Make the fit that states no prior."""
    return solve(prepared, load_model("baseline"), learn=False)


def stated(fit: Fit, name: str, sigmas: float, share: float) -> StatedPrior:
    """A prior at some sigmas from the estimate of a fit, its sigma a share of that of the fit."""
    k = fit.names.index(name)
    sigma = float(np.sqrt(fit.covariance[k, k]))
    return StatedPrior(name, float(fit.values[k]) + sigmas * sigma, share * sigma, fit.sensors.parameters[k].unit)


@pytest.mark.parametrize(
    ("name", "share"),
    [("accel_bias_y", 0.0), ("accel_bias_y", 0.5), ("gyro_scale_y", 0.0), ("gyro_misalignment_yz", 0.5)],
)
def test_a_stated_prior_conditions_the_fit_of_the_other_coefficients(prepared, free, name, share):
    """Theory: of a joint normal with covariance C, given ``x_i = m`` with variance s^2."""
    model = load_model("baseline")
    one = stated(free, name, 2.0, share)
    told = solve(prepared, replace(model, priors=(one,)), learn=False)
    C, k = free.covariance, free.names.index(name)
    gain = C[:, k] / (C[k, k] + one.sigma**2)
    values = free.values + gain * (one.mean - free.values[k])
    sigma = np.sqrt(np.maximum(np.diag(C - np.outer(gain, C[k])), 0.0))
    # Pinned and fixed ones have no sigma.
    alone = np.sqrt(np.diag(C))
    loose = (alone > 1e-15) & (sigma > 1e-3 * alone)
    # Passes end when nothing moves by 0.02 sigma; the prior of the IMU's file, left out here, is 1e-4 of it.
    assert (np.abs(told.values - values)[loose] < 0.02 * sigma[loose]).all()
    assert np.sqrt(np.diag(told.covariance))[loose] == pytest.approx(sigma[loose], rel=1e-3)
    if share == 0.0:
        assert told.values[k] == pytest.approx(one.mean, rel=1e-12)
        assert told.covariance[k, k] == 0.0


@pytest.mark.parametrize(
    ("prior", "word"),
    [
        (StatedPrior("gyro_bais_x", 0.0, 1.0, "deg/h"), "did you mean gyro_bias_x"),
        (StatedPrior("gyro_bias_x", 0.0, 1.0, "ppm"), "wrong unit"),
        (StatedPrior("gyro_bias_x", 0.0, -1.0, "deg/h"), "above zero"),
        (StatedPrior("accel_misalignment_xy", 0.0, 0.0, "arcmin"), "zero by definition"),
    ],
)
def test_a_prior_that_cannot_be_is_refused_by_name(prepared, prior, word):
    with pytest.raises(DataError, match=word) as caught:
        solve(prepared, replace(load_model("baseline"), priors=(prior,)))
    # A key of a file says nothing to who states a prior on a page.
    assert str(caught.value).startswith(f"prior of {prior.name}: ")


def test_an_estimator_that_takes_no_prior_says_so(prepared):
    model = replace(load_model("baseline"), priors=(StatedPrior("gyro_bias_x", 0.0, 0.0, "deg/h"),))
    with pytest.raises(DataError, match="'batch' takes priors from the IMU's file only"):
        solve(prepared, model, "batch")


def test_a_model_file_states_priors_in_customary_units(tmp_path):
    path = tmp_path / "model.yaml"
    path.write_text(
        "format: sdimu-model/1\neffects: [gyro_bias]\npriors:\n  gyro_bias_x: {value: -2 deg/h, sigma: 0 deg/h}\n",
        encoding="utf-8",
    )
    (one,) = load_model(path).priors
    assert one.mean == pytest.approx(-2.0 * np.pi / 180.0 / 3600.0)
    assert (one.name, one.sigma, one.unit) == ("gyro_bias_x", 0.0, "deg/h")
    path.write_text(path.read_text(encoding="utf-8").replace("0 deg/h", "0 ppm"), encoding="utf-8")
    with pytest.raises(DataError, match=r"priors\.gyro_bias_x: value and sigma have different units"):
        load_model(path)
