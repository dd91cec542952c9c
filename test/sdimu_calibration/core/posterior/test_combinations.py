"""Two effects that together are a third one are found from the information, and stand in the window."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sdimu_calibration.core.posterior.combinations import combinations_of, crossed, exchanged
from sdimu_calibration.core.posterior.search import best_from

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


def test_two_effects_that_together_are_two_others_are_exchanged_for_them():
    """Delays of x and y alike are a delay of the triad beside the opposite one of z: no other pair comes near."""
    rng = np.random.default_rng(5)
    W = drawn(6, rng, alike=0.0)
    W[:, 3] = W[:, 0] + W[:, 1] + W[:, 2]
    e = 3.0 * (W[:, 0] + W[:, 1]) + rng.standard_normal(len(W))
    data = data_of(W, e, prior(6))
    for here, there in (((0, 1), (2, 3)), ((2, 3), (0, 1))):
        members = tuple((number, 1) for number in here)
        (found,) = exchanged(data, members, data.at(members).score - 7.0)
        assert tuple(number for number, _ in found) == there
        # No climb of one move at a time comes from one to the other.
        assert best_from(data, members, of_two=False)[1] == members
    assert exchanged(data, members, data.at(found).score + 1e-6) == []


def test_what_comes_in_the_place_of_two_is_no_variant_of_them():
    rng = np.random.default_rng(6)
    W = drawn(5, rng, alike=0.0)
    W[:, 2:4] = W[:, 0:2] + 1e-3 * rng.standard_normal((len(W), 2))
    known = replace(prior(5), parameter=np.array([0, 1, 0, 1, 2]))
    data = data_of(W, 3.0 * (W[:, 0] + W[:, 1]) + rng.standard_normal(len(W)), known)
    assert exchanged(data, ((0, 1), (1, 1)), data.at(()).score + 1.0) == []


def test_what_happens_at_one_time_may_be_exchanged_for_other_times():
    """A model may have several steps of one bias."""
    rng = np.random.default_rng(7)
    W = drawn(4, rng, alike=0.0)
    W[:, 3] = W[:, 0] + W[:, 1] - W[:, 2]
    data = data_of(W, 3.0 * (W[:, 0] + W[:, 1]) + rng.standard_normal(len(W)), prior(4))
    steps = replace(data, prior=prior(4, parameter=np.zeros(4, dtype=int), repeats=np.ones(4, dtype=bool)))
    ((one, other),) = exchanged(steps, ((0, 1), (1, 1)), steps.at(()).score + 1.0)
    assert (one[0], other[0]) == (2, 3)
    variants = replace(data, prior=prior(4, parameter=np.array([0, 1, 0, 1])))
    assert exchanged(variants, ((0, 1), (1, 1)), data.at(()).score + 1.0) == []
    twins = replace(data, prior=prior(4, twin=np.array([0, 1, 0, 3])))
    assert exchanged(twins, ((0, 1), (1, 1)), data.at(()).score + 20.0) == []


def test_equal_delays_of_two_accelerometers_may_be_one_of_the_triad_beside_the_third(bench):
    diagnosis = bench.diagnosis(5, ("accel_delay_x=0.6 ms", "accel_delay_y=0.6 ms"), "recommended")
    window = diagnosis.found.posterior
    share = {}
    for model in window.models:
        delays = frozenset(one for k, _ in model.members if "delay" in (one := window.candidate(k).label))
        share[delays] = share.get(delays, 0.0) + model.probability
    assert share[frozenset(("accel_delay_x", "accel_delay_y"))] > 0.1
    assert share[frozenset(("accel_delay_z", "accel_triad_delay"))] > 0.1


def test_by_unit_force_a_cross_term_is_a_quadratic_term_with_the_other_cross_term(bench):
    """``ax^2 + ay^2 + az^2 = 1`` at rest: the three with equal sizes are a bias."""
    found = bench.diagnosis(4, ("accel_cross_square_xy=-34 ug/g^2",), "recommended")
    (place,) = [k for k, c in enumerate(found.chosen) if c.label == "accel_cross_square_xy"]
    window = found.found.posterior
    pairs = window.together(window.place_of(int(found.found.chosen[place])))
    told = {frozenset((window.candidate(one).label, window.candidate(other).label)): p for one, other, p in pairs}
    assert told[frozenset(("accel_quadratic_x", "accel_cross_square_xz"))] < 0.05
