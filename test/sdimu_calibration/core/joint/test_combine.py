"""The joint least squares against one that has every deviation as a parameter, and against the density of the data."""

import numpy as np
import pytest

from sdimu_calibration.core.joint.combine import Combination, Component, Rows
from sdimu_calibration.core.joint.turn_on import in_scatter, turn_on_scatter

P, V = 6, 2
"""Parameters, of which the first two vary."""
UNIT = np.array([1e-7, 1e-7, 1e-4, 1e-3, 1.0, 10.0])


def a_set(seed: int, groups: int, tau: float, rows: int = 25):
    """Data equations of power-ons whose first coefficients differ by `tau` units."""
    rng = np.random.default_rng(seed)
    theta = UNIT * rng.normal(size=P)
    made, deviations = [], []
    for _ in range(groups):
        own = np.zeros(P)
        own[:V] = tau * UNIT[:V] * rng.normal(size=V)
        A = 10.0 * rng.normal(size=(rows, P)) / UNIT
        made.append(Rows(A, A @ (theta + own) + rng.normal(size=rows)))
        deviations.append(own[:V])
    weight = np.full(P, 1e-2) / UNIT**2
    return theta, np.array(deviations), Combination(made, weight, [Component("b", np.arange(V))]), made, weight


@pytest.mark.parametrize("seed", range(5))
def test_estimate_is_that_of_all_parameters_and_deviations_at_once(seed):
    _, _, combined, groups, weight = a_set(seed, 4, 0.5)
    tau = 0.3e-7
    found = combined.estimate(np.array([tau]))
    size = P + V * len(groups)
    J, d = np.zeros((size, size)), np.zeros(size)
    for g, rows in enumerate(groups):
        wide = np.zeros((len(rows.y), size))
        wide[:, :P] = rows.A
        wide[:, P + V * g : P + V * (g + 1)] = rows.A[:, :V]
        J += wide.T @ wide
        d += wide.T @ rows.y
    J += np.diag(np.concatenate([weight, np.full(V * len(groups), tau**-2)]))
    scale = np.concatenate([UNIT, np.full(V * len(groups), 1e-7)])
    C = np.linalg.inv(J * np.outer(scale, scale)) * np.outer(scale, scale)
    dense = C @ d
    np.testing.assert_allclose(found.values / UNIT, dense[:P] / UNIT, atol=1e-9)
    np.testing.assert_allclose(found.covariance / np.outer(UNIT, UNIT), C[:P, :P] / np.outer(UNIT, UNIT), atol=1e-9)
    np.testing.assert_allclose(found.deviation.ravel() * 1e7, dense[P:] * 1e7, atol=1e-7)
    np.testing.assert_allclose(found.deviation_sigma.ravel() * 1e7, np.sqrt(np.diag(C)[P:]) * 1e7, atol=1e-7)


def test_likelihood_is_the_density_of_the_data():
    _, _, combined, groups, weight = a_set(3, 3, 0.5)

    def density(tau: float) -> float:
        blocks = [rows.A for rows in groups]
        A, y = np.vstack(blocks), np.concatenate([rows.y for rows in groups])
        S = A @ np.diag(1.0 / weight) @ A.T + np.eye(len(y))
        start = 0
        for block in blocks:
            end = start + len(block)
            S[start:end, start:end] += tau**2 * block[:, :V] @ block[:, :V].T
            start = end
        return -0.5 * (np.linalg.slogdet(S)[1] + y @ np.linalg.solve(S, y))

    sizes = [1e-9, 2e-8, 1e-7]
    line = combined.along(0, np.array([np.nan]))
    ours = [line.log_likelihood(tau) for tau in sizes]
    np.testing.assert_allclose(np.diff(ours), np.diff([density(tau) for tau in sizes]), rtol=1e-6)


def test_intervals_of_the_scatter_hold_it():
    # 200 sets of eight power-ons, two coefficients: 95 % of the intervals should, 90 to 99 % may by chance.
    tau, inside, none = 0.5, 0, 0
    for seed in range(200):
        _, _, combined, _, _ = a_set(seed, 8, tau)
        found = turn_on_scatter(combined)[0]
        inside += found.low <= tau * UNIT[0] <= found.high
    for seed in range(50):
        _, _, combined, _, _ = a_set(1000 + seed, 8, 0.0)
        none += turn_on_scatter(combined)[0].low == 0.0
    assert 180 <= inside <= 198
    assert none >= 45


@pytest.mark.parametrize("groups", [3, 8])
def test_errors_are_as_large_as_their_sigmas(groups):
    # With n = 2 (groups - 1) deviations the scatter is known as chi-square with n degrees of freedom. The second moment
    # of Student's t that follows from a flat prior is n s^2 / (n - 3), and E[1 / chi2_n] is 1 / (n - 2): few power-ons
    # have sigmas that are larger than most errors, by theory and by no choice.
    n = V * (groups - 1)
    theory = np.sqrt((n - 3) / (n - 2))
    z, own = [], []
    for seed in range(300):
        theta, deviations, combined, _, _ = a_set(seed, groups, 2.0)
        found = in_scatter(combined, turn_on_scatter(combined))
        z.append((found.values - theta) / np.sqrt(np.diag(found.covariance)))
        own.append((found.deviation - deviations) / found.deviation_sigma)
    rms = np.sqrt(np.mean(np.square(z), axis=0))
    np.testing.assert_allclose(rms[:V], theory, rtol=0.15)
    np.testing.assert_allclose(rms[V:], 1.0, rtol=0.15)
    assert np.sqrt(np.mean(np.square(own))) == pytest.approx(theory, rel=0.15)


def drawn_set(rng):
    """A set of any shape: few rows, columns of zeros, equal columns, no, one or two components at any places."""
    size = int(rng.integers(1, 7))
    columns = rng.permutation(size)[: rng.integers(0, size + 1)]
    cut = int(rng.integers(0, len(columns) + 1))
    components = [Component(n, c) for n, c in (("a", columns[:cut]), ("b", columns[cut:])) if len(c)]
    groups = []
    for _ in range(rng.integers(1, 5)):
        A = rng.normal(size=(int(rng.integers(0, 9)), size))
        A[:, rng.integers(size)] *= rng.choice([0.0, 1.0])
        A[:, 0] = A[:, -1] if rng.random() < 0.3 else A[:, 0]
        groups.append(Rows(A, 3.0 * rng.normal(size=len(A))))
    return groups, np.exp(rng.normal(size=size)), components


def all_at_once(groups, weight, components, tau):
    """Estimate with every deviation as a parameter of sigma one, and the density of the data."""
    varying = np.concatenate([np.empty(0, int), *(c.columns for c in components)]).astype(int)
    size = np.concatenate([np.empty(0), *(np.full(len(c.columns), t) for c, t in zip(components, tau, strict=True))])
    p, v = len(weight), len(varying)
    blocks = [
        np.hstack([g.A, *(g.A[:, varying] * size * (k == place) for k in range(len(groups)))])
        for place, g in enumerate(groups)
    ]
    A, y = np.vstack(blocks), np.concatenate([g.y for g in groups])
    prior = np.concatenate([weight, np.ones(v * len(groups))])
    C = np.linalg.inv(A.T @ A + np.diag(prior))
    x = C @ A.T @ y
    S = A @ np.diag(1.0 / prior) @ A.T + np.eye(len(y))
    density = 0.5 * (y @ y - y @ np.linalg.solve(S, y) - np.linalg.slogdet(S)[1] - np.log(weight).sum())
    return (
        x[:p],
        C[:p, :p],
        x[p:].reshape(len(groups), v) * size,
        np.sqrt(np.diag(C)[p:]).reshape(len(groups), v) * size,
        density,
    )


def test_a_set_of_any_shape_is_all_parameters_and_deviations_at_once():
    rng = np.random.default_rng(31)
    for _ in range(150):
        groups, weight, components = drawn_set(rng)
        tau = rng.choice([0.0, 0.1, 1.0, 1e3], size=len(components))
        combined = Combination(groups, weight, components)
        found = combined.estimate(tau)
        x, C, u, sigma, density = all_at_once(groups, weight, components, tau)
        np.testing.assert_allclose(found.values, x, atol=1e-6)
        np.testing.assert_allclose(found.covariance, C, atol=1e-6)
        np.testing.assert_allclose(found.deviation, u, atol=1e-5)
        np.testing.assert_allclose(found.deviation_sigma, sigma, rtol=1e-6, atol=1e-6)
        # Parameters have units of their own here, whose determinant is no part of the likelihood.
        assert found.log_likelihood + np.log(combined.unit).sum() == pytest.approx(density, abs=1e-6)
        for k, sigma_of_one in enumerate(tau):
            told = combined.along(k, tau).log_likelihood(float(sigma_of_one))
            assert told == pytest.approx(found.log_likelihood, abs=1e-6)


@pytest.mark.parametrize("weaker", [1e-2, 1e-4, 1e-6])
def test_a_coefficient_that_one_power_on_knows_far_better_than_others_has_a_scatter_in_any_order(weaker):
    rng = np.random.default_rng(0)
    groups = []
    for place in range(4):
        A = 10.0 * rng.normal(size=(8, 4))
        A[:, 0] *= weaker if place else 1.0
        groups.append(Rows(A, A @ rng.normal(size=4) + rng.normal(size=8)))
    few, all_of_them = Component("few", np.array([0])), Component("all", np.array([1]))
    found = [
        {t.effect: (t.sigma, t.high) for t in turn_on_scatter(Combination(groups, np.full(4, 0.01), order))}
        for order in ([few, all_of_them], [all_of_them, few])
    ]
    assert found[0]["all"] == pytest.approx(found[1]["all"], rel=1e-2)
    assert np.isfinite(found[0]["all"]).all()


def test_the_scatter_of_what_one_power_on_sees_has_the_bound_of_the_prior_and_of_what_none_sees_no_bound():
    rng = np.random.default_rng(0)
    groups = []
    for place in range(4):
        A = 10.0 * rng.normal(size=(8, 4))
        A[:, 0] *= place == 0
        A[:, 1] = 0.0
        groups.append(Rows(A, rng.normal(size=8)))
    one, none = (
        turn_on_scatter(Combination(groups, np.full(4, 0.01), [Component("a", np.array([k]))]))[0] for k in (0, 1)
    )
    # One value of a few sigmas of .04, under a prior of ten, lets a scatter of ten go and one of a hundred not.
    assert one.sigma == one.low == 0.0
    assert 10.0 < one.high < 100.0
    assert (none.sigma, none.low, none.high) == (0.0, 0.0, np.inf)
