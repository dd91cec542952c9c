"""Mean and covariance over all models are those of the mixture: the spread between models counts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from bare_prior import prior

from sdimu_calibration.core.posterior import coefficients
from sdimu_calibration.core.posterior.coefficients import Averages, _Beside, averaged
from sdimu_calibration.core.posterior.models import Data
from sdimu_calibration.core.posterior.noise_models import NoiseModel
from sdimu_calibration.core.posterior.posterior import Weighed
from sdimu_calibration.core.posterior.search import WINDOW


def test_moments_over_all_models_are_those_of_the_mixture(bench, monkeypatch):
    # Without what the averaged models lack, and with few models, so that some stand for others.
    monkeypatch.setattr(coefficients, "_LEAST_LACKING", 1.0)
    monkeypatch.setattr(coefficients, "_MOST", 60)
    monkeypatch.setattr(coefficients, "_LIKELIEST", 20)
    hidden = ("accel_quadratic_z=25 ug/g^2", "gyro_bias_warm_up_y(tau=300 s)=0.07 deg/h")
    diagnosis = bench.diagnosis(12, hidden, "recommended")
    found = diagnosis.found.posterior
    averages = Averages(found.board, diagnosis.fit.dwell_means)
    told, (models, weight) = averages.of(found), averaged(found.models)
    assert len(models) < len(found.models)
    each = [averages.of_model(m.members, m.noise) for m in models]
    mean = sum(w * one.mean for w, one in zip(weight, each, strict=True))
    second = sum(w * (one.covariance + np.outer(one.mean, one.mean)) for w, one in zip(weight, each, strict=True))
    scale = np.sqrt(np.diag(told.covariance))
    scale[scale == 0.0] = 1.0
    np.testing.assert_allclose((told.mean - mean) / scale, 0.0, atol=1e-9)
    right = (second - np.outer(mean, mean)) / np.outer(scale, scale)
    np.testing.assert_allclose(told.covariance / np.outer(scale, scale), right, atol=1e-6)
    within = sum(w * np.diag(one.covariance) for w, one in zip(weight, each, strict=True))
    # Which drift it is stays open, so that models differ.
    assert (np.diag(told.covariance) / np.where(within > 0.0, within, 1.0)).max() > 1.1
    assert weight.max() < 0.95


def test_chosen_models_stand_for_a_window_of_more():
    """Twelve effects are open, three improbable: the likeliest models have hardly any of these."""
    p = np.concatenate([np.full(12, 0.4), [0.05, 0.05, 0.05]])
    models = []
    for number in range(1 << len(p)):
        there = np.array([number >> k & 1 for k in range(len(p))], dtype=bool)
        members = tuple((k, 0) for k in np.flatnonzero(there).tolist())
        models.append(Weighed(members, NoiseModel(), float(np.prod(np.where(there, p, 1.0 - p)))))
    models.sort(key=lambda one: -one.probability)
    chosen, weight = averaged(models)
    assert len(chosen) <= 600
    assert len(set(chosen)) == len(chosen)
    assert weight.sum() == pytest.approx(1.0)
    assert chosen[:200] == models[:200]
    np.testing.assert_allclose(weight[:200], [one.probability for one in models[:200]], rtol=1e-9)

    def shares(some, weights):
        return np.array([sum(w for m, w in zip(some, weights, strict=True) if (k, 0) in m.members) for k in range(15)])

    # Three sigma of a sample of four hundred that is drawn at random.
    assert np.all(np.abs(shares(chosen, weight) - p) < 3.0 * np.sqrt(p * (1.0 - p) / 400.0))
    likeliest = models[:600]
    of_those = np.array([m.probability for m in likeliest])
    assert shares(likeliest, of_those / of_those.sum())[12:].max() < 0.01
    fewer, alone = averaged(models[:500])
    assert fewer == models[:500]
    assert alone.sum() == pytest.approx(1.0)


def test_of_models_behind_the_likeliest_each_counts_by_its_probability(monkeypatch):
    """Two stand for the six behind: one of these has more than a half of what is left, and is taken twice."""
    monkeypatch.setattr(coefficients, "_MOST", 4)
    monkeypatch.setattr(coefficients, "_LIKELIEST", 1)
    p = [0.4, 0.35, 0.06, 0.05, 0.05, 0.05, 0.04]
    models = [Weighed(((k, 0),), NoiseModel(), one) for k, one in enumerate(p)]
    chosen, weight = averaged(models)
    # Behind the first .6 in three steps of .2: their middles lie at .1, .3 and .5 of what is summed in that order.
    assert [m.members[0][0] for m in chosen] == [0, 1, 4]
    assert weight == pytest.approx([0.4, 0.4, 0.2])


def test_half_of_an_equation_that_no_physics_names_moves_no_coefficient(bench):
    diagnosis = bench.diagnosis(effects=("accel_z=15*ug*sin(2*pi*t/500 + 0.7)",))
    assert diagnosis.own
    found = diagnosis.found.posterior
    averages = Averages(found.board, diagnosis.fit.dwell_means)
    model = next(m for m in found.models if m.members)
    assert {found.candidate(number).family for number, _ in model.members} == {"own"}
    (member,) = model.members
    told, without = (averages.of_model(members, model.noise) for members in ((member,), ()))
    half = averages.of_model((member,), model.noise, as_told=False)
    scale = np.sqrt(np.diag(told.covariance))
    free = scale > 0.0
    scale[~free] = 1.0
    # Without the equation in the model its size is zero, and all else the same.
    np.testing.assert_allclose((half.mean - 0.5 * (told.mean + without.mean)) / scale, 0.0, atol=1e-6)
    moved = (told.mean - without.mean) / scale
    added = (half.covariance - told.covariance) / np.outer(scale, scale) - 0.25 * np.outer(moved, moved)
    assert np.abs(moved[free]).max() > 0.01
    # Beside it as much as is seen of the equation, in equal parts on the coefficients of its sensor alone.
    names = found.board.evidence.names[: len(scale)]
    of_sensor = np.array(
        [name.endswith(("accel_bias_z", "accel_scale_z")) or "accel_misalignment_z" in name for name in names]
    )
    np.testing.assert_allclose(added - np.diag(np.diag(added)), 0.0, atol=1e-6)
    np.testing.assert_allclose(np.diag(added)[~of_sensor], 0.0, atol=1e-6)
    signal = 2.0 * np.diag(added) * scale**2 * np.diag(found.board.in_noise(model.noise).J)[: len(scale)]
    z = diagnosis.found.steps[0].z
    assert signal[of_sensor].sum() == pytest.approx(z**2, rel=0.05)
    np.testing.assert_allclose(signal[of_sensor], signal[of_sensor].mean(), rtol=1e-6)


def test_several_equations_of_a_sensor_are_the_cause_together_or_none_is(bench):
    diagnosis = bench.diagnosis(effects=("accel_z=15*ug*sin(2*pi*t/500 + 0.7)",))
    found = diagnosis.found.posterior
    board, noise = found.board, NoiseModel()
    averages, p = Averages(board, diagnosis.fit.dwell_means), len(board.evidence.weight)
    every = {k: found.candidate(k) for k in range(len(board.use))}
    first = next(k for model in found.models for k, _ in model.members)
    of_sensor = [k for k, one in every.items() if one.family == "own" and one.effect.terms == every[first].effect.terms]
    J = board.in_noise(noise).J
    # Columns that say nearly the same: the sum of what each tells is far from what both do.
    alike = np.array([J[p + first, p + k] / np.sqrt(J[p + first, p + first] * J[p + k, p + k]) for k in of_sensor])
    near = of_sensor[int(np.argmin(np.abs(np.abs(alike) - 0.9)))]
    members = ((first, 2), (near, 2))
    half, told, without = (
        averages.of_model(members, noise, as_told=False),
        averages.of_model(members, noise),
        averages.of_model((), noise),
    )
    scale = np.sqrt(np.diag(told.covariance))
    scale[scale == 0.0] = 1.0
    np.testing.assert_allclose((half.mean - 0.5 * (told.mean + without.mean)) / scale, 0.0, atol=1e-6)
    moved = told.mean - without.mean
    hidden = np.diag(half.covariance - told.covariance) - 0.25 * moved**2
    signal = 2.0 * hidden * np.diag(J)[: len(scale)]
    assert signal.sum() == pytest.approx(explained(board, members) - explained(board, ()), rel=1e-4)


def explained(board, members):
    """Sum of squares that coefficients and members take up, those of the priors included."""
    data, p = board.in_noise(NoiseModel()), len(board.evidence.weight)
    at = [*range(p), *(p + k for k, _ in members)]
    A = data.J[np.ix_(at, at)] + np.diag(board.parameters(members)[1])
    scale = 1.0 / np.sqrt(np.diag(A))
    d = data.d[at] * scale
    return float(d @ np.linalg.solve(A * np.outer(scale, scale), d))


def test_what_no_averaged_model_holds_counts_with_its_probability_beside_the_likeliest(bench):
    """The likeliest model alone, against the mixture of it with each candidate beside it, by the definition."""
    diagnosis = bench.diagnosis(12, ("accel_quadratic_z=25 ug/g^2",), "recommended")
    found = diagnosis.found.posterior
    averages = Averages(found.board, diagnosis.fit.dwell_means)
    best = found.best
    near = found.board.data(best.noise)[1].at(best.members)
    table = near.gains()
    table[near.columns] = -np.inf
    wider = [(0.0, best.members)] + [
        (float(table[k, width]), tuple(sorted((*best.members, (int(k), int(width))))))
        for k, width in zip(*np.nonzero(table > -WINDOW), strict=True)
    ]
    # Each candidate is there or not, whatever the others are: the odds of two are the products of theirs.
    weight = np.exp([gain for gain, _ in wider])
    assert 0.05 < weight[1:].sum() < 1.0
    each = [averages.of_model(members, best.noise) for _, members in wider]
    alone = averages.of_model(best.members, best.noise)
    by_candidate = {}
    for w, (_, members), one in zip(weight[1:], wider[1:], each[1:], strict=True):
        (number,) = {k for k, _ in members} - {k for k, _ in best.members}
        by_candidate.setdefault(number, []).append((w, one))
    mean, second = alone.mean.copy(), alone.covariance.copy()
    for own in by_candidate.values():
        total = 1.0 + sum(w for w, _ in own)
        for w, one in own:
            apart = one.mean - alone.mean
            mean += w / total * apart
            second += w / total * (one.covariance - alone.covariance + np.outer(apart, apart))
    told = averages.of(replace(found, models=(replace(best, probability=1.0),)))
    scale = np.sqrt(np.diag(alone.covariance))
    scale[scale == 0.0] = 1.0
    np.testing.assert_allclose(told.mean / scale, mean / scale, atol=0.02)
    grown = np.diag(second) / scale**2
    assert grown.max() > 1.3
    np.testing.assert_allclose(np.diag(told.covariance) / scale**2, grown, atol=0.02, rtol=0.02)


def test_what_some_models_lack_is_the_part_of_its_probability_that_none_of_them_holds(bench):
    """Three models of unequal weight, one in noise, with a drift: every sum written down from moments of models."""
    diagnosis = bench.diagnosis(12, ("gyro_bias_warm_up_y(tau=300 s)=0.05 deg/h",), "recommended")
    found = diagnosis.found.posterior
    averages = Averages(found.board, diagnosis.fit.dwell_means)
    noisy = next(m for m in found.models if m.noise.terms)
    quiet = [m for m in found.models if not m.noise.terms]
    held_twice = next(m for m in quiet if len(m.members) > len(quiet[0].members))
    models = (quiet[0], replace(noisy, probability=quiet[0].probability / 2), replace(held_twice, probability=0.004))
    weight = np.array([m.probability for m in models])
    weight /= weight.sum()
    there = [beside(found.board, m) for m in models]
    total, held = {}, {}
    for w, model, odds in zip(weight, models, there, strict=True):
        for k, p in odds.items():
            total[k] = total.get(k, 0.0) + w * sum(p.values())
        for k, _ in model.members:
            held[k] = held.get(k, 0.0) + w
    mean, second = 0.0, 0.0
    for w, model, odds in zip(weight, models, there, strict=True):
        alone = averages.of_model(model.members, model.noise)
        for k, p in odds.items():
            lacks = max(total[k] - held.get(k, 0.0), 0.0)
            if lacks > 1e-4:
                for width, q in p.items():
                    one = averages.of_model(tuple(sorted((*model.members, (k, width)))), model.noise)
                    apart, share = one.mean - alone.mean, w * q * lacks / total[k]
                    mean = mean + share * apart
                    second = second + share * np.diag(one.covariance - alone.covariance + np.outer(apart, apart))
    assert any(0.0 < held.get(k, 0.0) < total[k] for k in total)
    assert any(found.candidate(k).effect.bias_drift and total[k] - held.get(k, 0.0) > 1e-4 for k in total)
    left_out = averages._left_out(models, weight)
    scale = np.sqrt(np.diag(alone.covariance))
    scale[scale == 0.0] = 1.0
    np.testing.assert_allclose(left_out.mean / scale, mean / scale, atol=1e-7)
    np.testing.assert_allclose(np.diag(left_out.covariance) / scale**2, second / scale**2, atol=1e-7)
    assert (second / scale**2).max() > 0.01


def beside(board, model):
    """Probability of each candidate of the catalogue beside a model, by width."""
    near = board.data(model.noise)[1].at(model.members)
    table = near.gains()
    table[near.data.prior.own] = -np.inf
    odds = {}
    for k, width in zip(*np.nonzero(table > -WINDOW), strict=True):
        odds.setdefault(int(k), {})[int(width)] = float(np.exp(table[k, width]))
    return {k: {width: o / (1.0 + sum(own.values())) for width, o in own.items()} for k, own in odds.items()}


def test_an_equation_that_no_physics_names_is_not_counted_beside_a_model():
    rng = np.random.default_rng(3)
    W = rng.standard_normal((40, 4))
    own = np.array([False, True, False, False])
    data = Data(W.T @ W, W.T @ (2.0 * W[:, :2].sum(axis=1) + rng.standard_normal(40)), prior(4, own=own))
    found = _Beside.of(data.at(((2, 0),)))
    assert data.at(((2, 0),)).gains()[1].max() > 0.0
    assert found.probability[1].sum() == 0.0
    assert found.probability[2].sum() == 0.0
    assert found.probability[0].sum() > 0.9
