"""What the square of a coefficient that its prior alone decides adds to mean and sigma of the others."""

from types import SimpleNamespace

import numpy as np
import pytest

from sdimu_calibration.core.estimation.noise_learning import in_noise
from sdimu_calibration.core.estimation.outcome import outcome
from sdimu_calibration.core.estimation.solve import solve
from sdimu_calibration.core.evidence.wander import Wander
from sdimu_calibration.core.filter.bend import bend
from sdimu_calibration.core.noise_term import NoiseTerm
from sdimu_calibration.core.recording import DivergedError
from sdimu_calibration.storage.files.config import load_imu, load_model, load_site
from sdimu_study.worlds import simulated_test

ANGLE, SCALE = 0, 1


def sensors(names=("gyro_misalignment_xz", "accel_scale_x", "gyro_bias_x"), units=("rad", "1", "rad/s")):
    parameters = [SimpleNamespace(name=n, unit=u) for n, u in zip(names, units, strict=True)]
    return SimpleNamespace(parameters=parameters)


class Curved:
    """Data that hold ``scale - slope a - a^2 / 2`` to `sigma`, beside a prior of the angle a."""

    slope, sigma, prior, truth = 0.004, 2e-5, 0.01, np.array([0.004, 0.0017, 1e-6])

    def about(self, at):
        """Gauss-Newton step from a point: estimate and covariance."""
        row = np.array([-(self.slope + at[ANGLE]), 1.0, 0.0]) / self.sigma
        held = self.truth[SCALE] - self.slope * self.truth[ANGLE] - 0.5 * self.truth[ANGLE] ** 2
        residual = (held - (at[SCALE] - self.slope * at[ANGLE] - 0.5 * at[ANGLE] ** 2)) / self.sigma
        known = np.diag([self.prior**-2, 0.0, 1e12])
        covariance = np.linalg.inv(np.outer(row, row) + known)
        return at + covariance @ (row * residual - known @ (at - [0.0, 0.0, 1e-6])), covariance

    def mode(self):
        at = np.zeros(3)
        for _ in range(20):
            at, covariance = self.about(at)
        return at, covariance


def test_the_moments_are_those_of_the_curved_posterior():
    data = Curved()
    mode, covariance = data.mode()
    found = bend(sensors(), mode, covariance, data.about)
    rng = np.random.default_rng(3)
    angle = rng.normal(0.0, data.prior, 400_000)
    held = data.truth[SCALE] - data.slope * data.truth[ANGLE] - 0.5 * data.truth[ANGLE] ** 2
    scale = held + data.slope * angle + 0.5 * angle**2 + rng.normal(0.0, data.sigma, len(angle))
    more = found.covariance[SCALE, SCALE]
    # The square is three quarters of the variance; 400,000 draws tell that to .6 %.
    assert mode[SCALE] + found.mean[SCALE] == pytest.approx(scale.mean(), abs=4 * scale.std() / np.sqrt(len(scale)))
    assert covariance[SCALE, SCALE] + more == pytest.approx(scale.var(), rel=0.025)
    assert more == pytest.approx(0.5 * data.prior**4, rel=0.05)
    assert found.mean[ANGLE] == pytest.approx(0.0, abs=1e-3 * data.prior)


def test_what_the_data_show_is_not_looked_at():
    def never(_):
        raise AssertionError("a pass was made")

    # The square of .003 is 9e-6, and the scale factor is known to 1e-5.
    found = bend(sensors(), np.zeros(3), np.diag([0.003, 1e-5, 1e-2]) ** 2, never)
    assert not found.mean.any()
    assert not found.covariance.any()


def test_what_goes_along_with_it_is_looked_at_once():
    looked = []

    def flat(at):
        looked.append(at)
        return at, covariance

    # All that the scale factor is not known by goes along with the angle, but for 1e-5.
    covariance = np.array([[1e-4, 9e-5, 0.0], [9e-5, 8.1e-5 + 1e-10, 0.0], [0.0, 0.0, 1e-10]])
    three = sensors(("gyro_misalignment_xz", "accel_scale_x", "accel_scale_y"), ("rad", "1", "1"))
    found = bend(three, np.zeros(3), covariance, flat)
    assert len(looked) == 2
    assert not found.covariance.any()


def test_what_is_fixed_does_not_count():
    def never(_):
        raise AssertionError("a pass was made")

    assert not bend(sensors(), np.zeros(3), np.diag([0.003, 0.0, 1e-2]) ** 2, never).mean.any()


def test_where_passes_diverge_nothing_is_said():
    def diverges(_):
        raise DivergedError("the passes diverge")

    data = Curved()
    mode, covariance = data.mode()
    assert not bend(sensors(), mode, covariance, diverges).covariance.any()


@pytest.fixture(scope="module")
def six_positions():
    """Fit of a test that shows no turn about Z: three misalignments hang together there."""
    test, _ = simulated_test(
        "mems_consumer", load_imu("mems_consumer"), "six_positions", load_site("daejeon"), 151001, (), (), 20.0
    )
    return solve(test, load_model("baseline"), learn=False)


def test_passes_end_where_data_and_the_turned_prior_balance(six_positions):
    evidence, inner = six_positions.bare, six_positions.setup.sensors
    data = evidence.W.T @ evidence.e
    prior = inner.prior_information @ (inner.mean - six_positions.estimate)
    step = np.linalg.solve(evidence.W.T @ evidence.W + inner.prior_information, data + prior)
    assert np.abs(step / np.sqrt(np.diag(six_positions.last.covariance))).max() < 0.1


def test_noise_of_next_to_no_size_moves_nothing_that_the_prior_decides(six_positions):
    tiny = NoiseTerm("gyro", "random walk", size=1e-15)
    noisy = in_noise(six_positions, [tiny], Wander.of(six_positions.bare))
    sigma = np.sqrt(np.diag(six_positions.covariance))
    free = sigma > 0.0
    assert np.abs((noisy.values - six_positions.values)[free] / sigma[free]).max() < 0.1
    np.testing.assert_allclose(np.sqrt(np.diag(noisy.covariance))[free], sigma[free], rtol=0.05)


def test_scale_factors_have_the_half_square_of_the_angle_in_their_sigma(six_positions):
    names = six_positions.setup.sensors.names
    angle, scale = names.index("gyro_misalignment_xz"), names.index("accel_scale_x")
    sigma = np.sqrt(six_positions.last.covariance[angle, angle])
    more = np.sqrt(six_positions.bend.covariance[scale, scale])
    assert 0.5 < more / (sigma**2 / np.sqrt(2.0)) < 2.0
    told = outcome(six_positions)
    k = told.names.index("accel_scale_x")
    without = six_positions.last.covariance[scale, scale]
    assert told.covariance[k, k] == pytest.approx(without + more**2, rel=1e-9)


def test_a_plan_that_shows_everything_makes_no_pass_for_it():
    test, _ = simulated_test(
        "mems_consumer", load_imu("mems_consumer"), "kim18", load_site("daejeon"), 151002, (), (), 20.0
    )
    found = solve(test, load_model("baseline"), learn=False)
    assert not found.bend.mean.any()
    assert not found.bend.covariance.any()
