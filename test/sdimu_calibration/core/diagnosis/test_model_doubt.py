"""Models that the data leave open widen the covariance by what a mixture of them spreads."""

from __future__ import annotations

from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.diagnosis.diagnose import climb
from sdimu_calibration.core.diagnosis.model_doubt import model_doubt
from sdimu_calibration.core.effects import registry
from sdimu_calibration.core.estimation.fit import Fit
from sdimu_calibration.core.evidence.candidate import split
from sdimu_calibration.core.evidence.linear import LinearEvidence
from sdimu_calibration.storage.files.config import load_imu

RNG = np.random.default_rng(5)
PRIOR = np.array([2.0, 2.0, 2.0])
WIDE = 1000.0
"""Factor on the priors at which they hold nothing back, whatever the search makes of them."""
FIT = cast("Fit", SimpleNamespace(dwell_means=lambda effect: np.zeros(len(effect.terms))))


@dataclass(frozen=True)
class Bare(LinearEvidence):
    """A linear model without a test behind it."""

    def signature(self, effects: Any) -> Floats:
        """Nothing further is tried."""
        raise NotImplementedError


def linear_model(truth: Floats, noise: float = 1.0, ratio: float = 1.0) -> Bare:
    """Two coefficients and three candidates; the last two candidates alike but for a coefficient."""
    rows = 200
    base = RNG.standard_normal((rows, 2))
    first = base[:, 0] + 0.3 * RNG.standard_normal(rows)
    second = 0.5 * base[:, 1] + RNG.standard_normal(rows)
    third = second + 0.6 * base[:, 0] + 0.05 * RNG.standard_normal(rows)
    W = 0.2 * np.column_stack([base, first, second, third])
    names = ("accel_quadratic", "accel_cubic", "accel_bias_asymmetry")
    candidates = tuple(split(registry.get(name))[0] for name in names)
    e = W @ truth + noise * RNG.standard_normal(rows)
    return Bare(
        e=e,
        W=W,
        stop=np.arange(rows) // 10,
        names=("a", "b", *(c.label for c in candidates)),
        weight=np.full(2, 1e-6),
        shift=np.zeros(2),
        stated=np.ones(2),
        candidates=candidates,
        prior=ratio * PRIOR,
        imu=load_imu("dtg"),
        times=cast("Any", None),
        coefficients=2,
    )


def posterior(model: Bare, columns: list[int]) -> tuple[float, Floats, Floats]:
    """Log evidence, and mean and covariance of the coefficients, each candidate with its prior."""
    chosen = np.array(columns, dtype=int)
    weight = np.concatenate([model.weight, model.prior[chosen - 2] ** -2.0])
    W = model.W[:, np.concatenate([[0, 1], chosen])]
    A = W.T @ W + np.diag(weight)
    mean = np.linalg.solve(A, W.T @ model.e)
    log = 0.5 * mean @ A @ mean - 0.5 * np.linalg.slogdet(A)[1] - np.sum(np.log(model.prior[chosen - 2]))
    return float(log), mean[:2], np.linalg.inv(A)[:2, :2]


def spread(model: Bare, about: list[int], models: list[tuple[float, list[int]]], stays: bool = False) -> Floats:
    """Second moment about one model over several with prior odds, less the covariance in the one.

    With `stays` the variance that the last effect of `about` brings stays, also where it is not in the model.
    """
    _, mean, covariance = posterior(model, about)
    log = np.array([np.log(odds) + posterior(model, columns)[0] for odds, columns in models])
    share = np.exp(log - log.max())
    share /= share.sum()
    out = -covariance
    for weight, (_, columns) in zip(share, models, strict=True):
        _, m, C = posterior(model, columns)
        out = out + weight * (C + np.outer(m - mean, m - mean))
        if stays and columns != about:
            out = out + weight * (covariance - posterior(model, about[:-1])[2])
    return out


@pytest.mark.parametrize("size", [0.0, 1.5, 3.0])
def test_an_effect_too_small_to_be_found_widens_the_sigma_as_the_mixture_of_models_does(size: float) -> None:
    model = linear_model(np.array([1.0, -1.0, size, 0.0, 0.0]))
    got = model_doubt(FIT, model, [], np.array([2, 3, 4]), 1.0)
    expected = spread(model, [], [(1.0, []), *((1.0 / 3.0, [c]) for c in (2, 3, 4))])
    assert got == pytest.approx(expected, rel=1e-6)


def test_two_effects_that_look_alike_widen_the_sigma_by_what_lies_between_them() -> None:
    model = linear_model(np.array([1.0, -1.0, 0.0, 4.0, 0.0]), ratio=WIDE)
    got = model_doubt(FIT, model, [3], np.array([3, 4]), 1.0)
    other = spread(model, [3], [(1.0, [3]), (1.0, [4]), (2.0, [])], stays=True)
    # One effect more beside one that was found, at odds of two in the two that were looked at.
    more = spread(model, [3], [(1.0, [3]), (1.0, [3, 4])])
    assert np.trace(other) > 0.01 * np.trace(posterior(model, [3])[2])
    assert got[:2, :2] == pytest.approx(other + more, rel=1e-3, abs=1e-3 * np.trace(other))


def test_an_effect_found_at_the_threshold_leaves_the_model_without_it_open() -> None:
    model = linear_model(np.array([1.0, -1.0, 4.8, 0.0, 0.0]), ratio=WIDE)
    got = model_doubt(FIT, model, [2], np.array([2]), 1.0)
    expected = spread(model, [2], [(1.0, [2]), (1.0, [])], stays=True)
    assert np.trace(expected) > 0.05 * np.trace(posterior(model, [2])[2])
    assert got[:2, :2] == pytest.approx(expected, rel=1e-3, abs=1e-3 * np.trace(expected))


def test_a_drift_in_the_place_of_cable_wrap_moves_the_bias_to_its_mean() -> None:
    """Beside cable wrap or temperature the bias is that without them, beside a drift the mean over the dwells."""
    model = linear_model(np.array([1.0, -1.0, 0.0, 4.0, 0.0]), ratio=WIDE)
    mean = cast("Fit", SimpleNamespace(dwell_means=lambda effect: np.full(len(effect.terms), 2.0)))
    found = {}
    for rival in ("accel_bias_ramp", "accel_bias_temperature"):
        alike = tuple(split(registry.get(name))[0] for name in ("accel_bias_wrap", rival))
        candidates = (model.candidates[0], *alike)
        named = replace(model, names=("accel_bias_x", "b", *(c.label for c in candidates)), candidates=candidates)
        found[rival] = model_doubt(mean, named, [3], np.array([3, 4]), 1.0)
    drift, no_drift = found["accel_bias_ramp"], found["accel_bias_temperature"]
    _, _, covariance = posterior(model, [3])
    assert drift[0, 0] > no_drift[0, 0] + covariance[0, 0]
    assert drift[1, 1] == pytest.approx(no_drift[1, 1])


@pytest.mark.parametrize("seed", range(20))
def test_the_covariance_stays_positive_with_two_finds_that_resemble_each_other(seed: int) -> None:
    rng = np.random.default_rng(seed)
    model = linear_model(np.array([1.0, -1.0, 2.0 * rng.normal(), 2.0, 2.0 * rng.normal()]))
    chosen = [3, 4]
    weight = np.concatenate([model.weight, model.prior[1:] ** -2.0])
    A = model.information.J[np.ix_([0, 1, *chosen], [0, 1, *chosen])] + np.diag(weight)
    covariance = np.linalg.inv(A) + model_doubt(FIT, model, chosen, np.array([2, 3, 4]), 1.0)
    unit = 1.0 / np.sqrt(np.diag(covariance))
    assert np.linalg.eigvalsh(covariance * np.outer(unit, unit)).min() > 0.0
    assert (np.diag(covariance) >= np.diag(np.linalg.inv(A))).all()


def test_what_nothing_can_be_mistaken_for_widens_nothing() -> None:
    model = linear_model(np.array([1.0, -1.0, 0.0, 40.0, 0.0]), noise=0.1)
    doubt = model_doubt(FIT, model, [3], np.array([3]), 1.0)
    assert doubt == pytest.approx(np.zeros((3, 3)), abs=1e-12)


def test_the_sigma_of_a_diagnosis_is_at_least_the_conditional_one(bench: Any) -> None:
    found = climb(bench.fit(seed=104))
    conditional = found.after.conditional_sigma
    assert conditional is not None
    sigma = np.sqrt(np.diag(found.after.covariance))
    free = conditional > 0.0
    assert (sigma[free] >= conditional[free] * (1.0 - 1e-9)).all()
    assert (sigma[free] < 3.0 * conditional[free]).all()
    again = replace(found.extended, doubt=None).covariance
    assert np.sqrt(np.diag(again)) == pytest.approx(conditional)
