"""Coefficients that change at random, estimated by passes about exactly corrected samples."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from sdimu_calibration.core.effects import registry
from sdimu_calibration.core.effects.effect import Effect
from sdimu_calibration.core.estimation.fit import Fit
from sdimu_calibration.core.estimation.prepared_test import PreparedTest
from sdimu_calibration.core.estimation.solve import extend, solve
from sdimu_calibration.core.units import to_si
from sdimu_calibration.storage.files.config import load_imu, load_model, load_plan, load_site
from sdimu_sim.core.scenario import Scenario, imu_truth
from sdimu_sim.core.truth import ImuTruth
from sdimu_study.worlds import simulate, true_values

TAU_S = 300.0
SIZE = to_si(6.0, "deg/h")
"""Of the bias that fades: hundreds of times what white noise leaves of a bias in such a test."""


def wandering() -> Effect:
    """Gyro biases as first-order Gauss-Markov processes."""
    bias = registry.get("gyro_bias")
    named = tuple(replace(p, name=p.name.replace("gyro_bias", "wandering_bias")) for p in bias.parameters)
    density = dict.fromkeys(bias.prior, SIZE * np.sqrt(2.0 / TAU_S))
    sizes = dict.fromkeys(bias.prior, SIZE)
    return replace(bias, name="wandering_bias", parameters=named, prior=sizes, decay_s=TAU_S, random_walk=density)


def simulated(seed: int) -> tuple[PreparedTest, ImuTruth]:
    imu, site = load_imu("mems_industrial"), load_site("daejeon")
    noise = (f"gyro_noise_markov(tau={TAU_S:g} s)=6 deg/h",)
    scenario = Scenario(load_plan("kim18"), imu, site, rate_hz=10.0, seed=seed, noise=noise)
    sensor = imu_truth(scenario)
    return PreparedTest(simulate(scenario, sensor), imu, site), sensor


def z_of_the_constants(fit: Fit, sensor: ImuTruth) -> np.ndarray:
    """Errors over sigma; a bias beside one that fades is not the one that was built in."""
    names = [n for n in fit.names if "bias" not in n or n.startswith("accel")]
    rows = [fit.names.index(n) for n in names]
    sigma = np.sqrt(np.diag(fit.covariance))[rows]
    error = fit.values[rows] - true_values(sensor, names, fit.body_frame)
    return error[sigma > 0.0] / sigma[sigma > 0.0]


@pytest.fixture(scope="module")
def fits():
    out = []
    for seed in (901, 902, 904):
        test, sensor = simulated(seed)
        base = load_model("baseline")
        out.append((solve(test, replace(base, effects=(*base.effects, wandering())), learn=False), sensor))
    return out


def test_passes_with_a_coefficient_that_fades_converge_with_errors_of_per_cent(fits):
    assert all(fit.converged and fit.passes <= 8 for fit, _ in fits)


def test_the_others_are_honest_beside_it(fits):
    z = np.concatenate([z_of_the_constants(fit, sensor) for fit, sensor in fits])
    assert len(z) == 3 * 24
    # 72 errors over sigma: their RMS scatters by a twelfth.
    assert 0.7 < np.sqrt(np.mean(z**2)) < 1.3
    assert all(fit.statistics().nis_mean == pytest.approx(1.0, abs=0.05) for fit, _ in fits)


def test_taken_for_a_constant_it_spoils_them(fits):
    test, sensor = simulated(901)
    plain = solve(test, load_model("baseline"), learn=False)
    z = z_of_the_constants(plain, sensor)
    assert np.sum(z**2) > chi2.ppf(1.0 - 5e-4, len(z))
    assert extend(plain, [wandering()], learn=False).values == pytest.approx(fits[0][0].values)
