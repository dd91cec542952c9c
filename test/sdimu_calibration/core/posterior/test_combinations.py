"""Two effects that together are a third one are found from the information, and stand in the window."""

from __future__ import annotations

import numpy as np
import pytest

from sdimu_calibration.core.posterior.combinations import combinations_of, crossed

from .test_models import data_of, drawn, prior


@pytest.fixture
def data():
    """Signatures of which the last one is twice the first less the third, and nothing else is an identity."""
    rng = np.random.default_rng(4)
    W = drawn(6, rng, alike=0.3)
    W[:, 5] = 2.0 * W[:, 0] - W[:, 2]
    return data_of(W, 8.0 * W[:, 5] / np.linalg.norm(W[:, 5]) + rng.standard_normal(len(W)), prior(6))


def test_an_identity_is_found_from_each_of_its_sides(data):
    assert combinations_of(data, 5) == [(0, 2)]
    assert combinations_of(data, 0) == [(2, 5)]
    assert combinations_of(data, 1) == []


def test_a_model_is_crossed_to_the_pair_with_its_best_widths(data):
    (pair,) = crossed(data, ((5, 0),))
    assert [number for number, _ in pair] == [0, 2]
    other = tuple((number, 2) for number, _ in pair)
    assert data.at(pair).score >= data.at(other).score
    assert crossed(data, ((0, 0), (2, 0), (5, 0))) == []


def test_by_unit_force_a_cross_term_is_a_quadratic_term_with_the_other_cross_term(bench):
    """``ax^2 + ay^2 + az^2 = 1`` at rest: the three with equal sizes are a bias."""
    found = bench.diagnosis(4, ("accel_cross_square_xy=-34 ug/g^2",), "recommended")
    (place,) = [k for k, c in enumerate(found.chosen) if c.label == "accel_cross_square_xy"]
    window = found.found.posterior
    pairs = window.together(window.place_of(int(found.found.chosen[place])))
    told = {frozenset((window.candidate(one).label, window.candidate(other).label)): p for one, other, p in pairs}
    assert told[frozenset(("accel_quadratic_x", "accel_cross_square_xz"))] < 0.05
