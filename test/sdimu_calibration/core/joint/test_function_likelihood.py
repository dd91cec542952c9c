"""The likelihood of a shared function against that of all measurements written out."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from types import SimpleNamespace

import numpy as np
import pytest

from sdimu_calibration.core.evidence.attitude_functions import AttitudeFunctions
from sdimu_calibration.core.joint.function_fit import function_sizes, with_own_weights
from sdimu_calibration.core.joint.function_prior import OF_FIT, FunctionPrior, OwnWeights
from sdimu_calibration.core.joint.reduction import Reduction
from sdimu_calibration.core.joint.set_board import Share, beside_own
from sdimu_calibration.core.joint.shared_function import SharedFunction
from sdimu_calibration.core.posterior.noise_models import usual_sizes
from sdimu_calibration.storage.files.config import load_imu

NAMES = ("gyro_bias_x", "accel_scale_x", "accel_bias_x")
WEIGHT = np.array([1e10, 1e8, 1e7])
SHARED = SharedFunction(
    AttitudeFunctions(np.eye(3)[:2]), ("gyro_x", "accel_y"), np.eye(3), {"gyro_x": 1e-6, "accel_y": 3e-4}
)


def recording(name: str, rng: np.random.Generator, y_of=None) -> SimpleNamespace:
    """Rows of a recording of one power-on: random signatures, and measurements that nothing or `y_of` them makes."""
    unit = np.array([1e6, 1e4, 1e4] + [1e6 if "gyro" in label else 1e4 for label in SHARED.labels])
    A = rng.standard_normal((12, len(unit))) * unit
    y = rng.standard_normal(12) + (0.0 if y_of is None else y_of(A))
    rows = Reduction(NAMES, SHARED.labels, A, y, np.zeros(3), WEIGHT, 12, 0.0)
    return SimpleNamespace(name=name, power_on=name, reduction=rows)


@dataclass(frozen=True)
class Fit:
    """What the likelihood asks of a fit."""

    names: tuple[str, ...] = NAMES
    weight: np.ndarray = field(default_factory=lambda: WEIGHT)
    varying: dict[str, tuple[str, ...]] = field(default_factory=dict)
    turn_on: tuple[SimpleNamespace, ...] = ()

    @property
    def tau(self) -> np.ndarray:
        return np.array([t.sigma for t in self.turn_on])


def fit_of(varying, tau) -> Fit:
    return Fit(varying=varying, turn_on=tuple(SimpleNamespace(sigma=sigma) for sigma in tau))


@pytest.mark.parametrize("size", [{}, {"gyro_x": 5e-6, "accel_y": 1e-5}])
@pytest.mark.parametrize(("varying", "tau"), [({}, []), ({"bias": ("gyro_bias_x", "accel_bias_x")}, [2e-6])])
def test_it_is_that_of_the_measurements_themselves(size, varying, tau):
    rng = np.random.default_rng(3)
    reports = [recording(name, rng) for name in "abc"]
    shared = replace(SHARED, size=size or SHARED.size)
    A, y = (np.concatenate([getattr(r.reduction, part) for r in reports]) for part in ("A", "y"))
    prior = np.diag(1.0 / np.concatenate([WEIGHT, shared.known]))
    covariance = A @ prior @ A.T + np.eye(len(y))
    moving = [NAMES.index(name) for own in varying.values() for name in own]
    for k in range(3):
        own = slice(12 * k, 12 * k + 12)
        covariance[own, own] += sum(tau) ** 2 * A[own][:, moving] @ A[own][:, moving].T
    expected = 0.5 * (y @ y - y @ np.linalg.solve(covariance, y) - np.linalg.slogdet(covariance)[1])
    fit = fit_of(varying, tau)
    assert function_sizes(fit, reports, shared).log_likelihood(shared.size) == pytest.approx(expected, abs=1e-8)


@pytest.mark.parametrize("tau", [[], [2e-6]])
def test_the_likeliest_size_of_a_sensor_is_the_one_that_a_step_does_not_better(tau):
    rng = np.random.default_rng(5)
    weights = np.array([0.0, 0.0, 0.0, 1e-5, -4e-3, 2e-5, 3e-3])
    fit = fit_of({"bias": ("gyro_bias_x",)} if tau else {}, tau)
    sizes = function_sizes(fit, [recording(name, rng, lambda A: A @ weights) for name in "abc"], SHARED)
    found = sizes.likeliest({})
    best = sizes.log_likelihood(found)
    assert best > sizes.log_likelihood({sensor: 1e-3 * size for sensor, size in sizes.seen.items()}) + 10.0
    # The last one was sought with the others as they are told.
    last = SHARED.sensors[-1]
    assert all(sizes.log_likelihood({**found, last: found[last] * step}) < best for step in (0.7, 1.4))


def test_another_size_on_the_board_is_that_of_a_fit_in_this_size():
    """About the estimate in one size: information, its vector and the likelihood of any other size."""
    rng = np.random.default_rng(4)
    labels, p = SHARED.labels, len(NAMES)
    A = rng.standard_normal((30, p + len(labels))) * np.concatenate([[1e6, 1e4, 1e4], SHARED.known**0.5 * 2.0])
    y = rng.standard_normal(30) + 5.0

    def scored(known: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
        """Estimate, its information, and log-likelihood of the weights up to what all sizes have in common."""
        J, d = A.T @ A + np.diag(np.concatenate([WEIGHT, known])), A.T @ y
        theta = np.linalg.solve(J, d)
        return theta, J, 0.5 * (d @ theta - np.linalg.slogdet(J)[1] + np.log(known).sum())

    theta, fitted, at_size = scored(SHARED.known)
    evidence = SimpleNamespace(
        names=(*NAMES, *labels), weight=np.concatenate([WEIGHT, SHARED.known]), shift=-theta, imu=load_imu("dtg")
    )
    prior = FunctionPrior(SHARED, evidence, usual_sizes(evidence.imu))  # type: ignore[arg-type]
    of_fit = prior.nearest(SHARED.size)
    assert of_fit == (OF_FIT, OF_FIT)
    assert np.allclose(prior.change(of_fit).more, 0.0, atol=1e-9 * SHARED.known.max())
    for chosen in ((0, 0), (2, of_fit[1]), (6, 3)):
        change = prior.change(chosen)
        sizes = {s: float(prior.sizes[k][chosen[k]]) for k, s in enumerate(SHARED.sensors)}
        expected, information, likelihood = scored(replace(SHARED, size=sizes).known)
        J = fitted.copy()
        J[change.columns, change.columns] += change.more
        d = np.zeros(len(theta))
        d[change.columns] -= change.more * change.values
        step = np.linalg.solve(J, d)
        np.testing.assert_allclose(J, information, rtol=1e-9, atol=1e-6 * np.diag(J).min())
        np.testing.assert_allclose(theta + step, expected, rtol=1e-6, atol=1e-9 * np.abs(expected).max())
        explained = d @ step - change.more @ change.values**2
        gained = 0.5 * (explained - change.log_det - np.linalg.slogdet(J)[1] + np.linalg.slogdet(fitted)[1])
        assert gained == pytest.approx(likelihood - at_size, abs=1e-6)


def test_a_function_of_one_recording_adds_to_the_common_one():
    """Its weights integrated: the likelihood of rows with the covariance of weights that are theirs alone."""
    rng = np.random.default_rng(8)
    p, size = 3, np.array([0.7, 2.0])
    A, y = rng.standard_normal((12, p + 2)), rng.standard_normal(12)
    said = beside_own(Share(A.T @ A, A.T @ y, 0.0, 0.0), np.array([3, 4]), size)
    covariance = np.eye(12) + (A[:, 3:] * size**2) @ A[:, 3:].T
    np.testing.assert_allclose(said.J, A.T @ np.linalg.solve(covariance, A), rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(said.d, A.T @ np.linalg.solve(covariance, y), rtol=1e-9, atol=1e-12)
    assert said.explained == pytest.approx(y @ y - y @ np.linalg.solve(covariance, y))
    assert said.log_det == pytest.approx(np.linalg.slogdet(covariance)[1])


def test_a_set_without_a_function_has_no_sizes():
    evidence = SimpleNamespace(names=NAMES, weight=WEIGHT, shift=np.zeros(3))
    prior = FunctionPrior(None, evidence, usual_sizes(load_imu("dtg")))  # type: ignore[arg-type]
    assert prior.counts == ()
    assert prior.log_prior(()) == 0.0
    assert len(prior.change(()).columns) == 0


def test_rows_with_weights_of_their_own_are_those_with_the_covariance_of_the_function():
    rng = np.random.default_rng(11)
    labels, p = SHARED.labels, len(NAMES)
    names, point = (*NAMES, *labels), np.concatenate([np.zeros(p), rng.standard_normal(len(labels))])
    A, y = rng.standard_normal((20, len(names) + 1)), rng.standard_normal(20)
    rows = Reduction(names, ("candidate",), A, y, point, np.concatenate([WEIGHT, SHARED.known]), 20, 0.0)
    of_sensor = [k for k, label in enumerate(labels) if label.startswith("accel_y")]
    own = OwnWeights(tuple(labels[k] for k in of_sensor), np.array([0.7, 2.0]))
    found = with_own_weights(rows, "r1", own)
    assert found.names == (*NAMES, *(f"{label}@r1" for label in own.labels))
    assert found.labels == ("candidate",)
    # Integrated over their prior the rows have the covariance of the function of that sensor; the other has none.
    told, of_own = found.A[:, [*range(p), -1]], found.A[:, p:-1]
    covariance = np.eye(20) + (of_own / found.weight[p:]) @ of_own.T
    columns = A[:, p + np.array(of_sensor)]
    np.testing.assert_allclose(covariance, np.eye(20) + columns * own.size**2 @ columns.T, rtol=1e-12)
    np.testing.assert_array_equal(told, A[:, [*range(p), -1]])
    np.testing.assert_array_equal(found.point[p:], point[p + np.array(of_sensor)])
    np.testing.assert_array_equal(found.weight[:p], WEIGHT)
