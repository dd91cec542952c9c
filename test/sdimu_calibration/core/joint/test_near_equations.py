"""Equations that no physics names, in a set."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest

from sdimu_calibration.core.estimation.solve import solve
from sdimu_calibration.core.joint import near_equations
from sdimu_calibration.core.joint.equation_share import (
    EquationShare,
    asked,
    equation_share,
    name_of_candidate,
    single_equations,
)
from sdimu_calibration.core.joint.set_diagnosis import diagnose_set
from sdimu_calibration.core.verdict import Verdict

from .conftest import here, short, unit_set

HIDDEN = "accel_y: ax^2 az"


@pytest.fixture(scope="module")
def test_of_one():
    return unit_set(9302, [short("kim18_signed", 10, 30.0)]).members[0].open()


def explained(A, y, weight):
    """Log likelihood that columns gain, their sizes normal with some information."""
    return 0.5 * (A.T @ y) @ np.linalg.solve(A.T @ A + np.diag(weight), A.T @ y)


def test_gains_are_those_of_a_least_squares_in_which_some_effects_are_left_out():
    rng = np.random.default_rng(5)
    T, E, y, weight = rng.normal(size=(60, 3)), rng.normal(size=(60, 4)), 3.0 * rng.normal(size=60), np.full(3, 0.5)
    values = rng.normal(size=3)
    left = y - T @ values
    share = EquationShare(
        tuple("abcd"), ("p", "q", "r"), T.T @ T, E.T @ T, np.sum(E**2, axis=0), T.T @ left, E.T @ left
    )
    told = near_equations.gains_in_place(share, values, weight)
    full = explained(T, y, weight)
    choices = [c for size in range(4) for c in combinations(range(3), size)]
    for k in range(4):
        best = max(
            explained(np.column_stack([T[:, kept], E[:, k]]), y, np.append(weight[list(kept)], 0.0))
            - full
            + near_equations._MEMBER * (3 - len(kept))
            for kept in map(list, choices)
        )
        assert told[k] == pytest.approx(best, rel=1e-9)


def test_the_share_of_a_recording_is_what_its_evidence_says_of_an_equation(test_of_one, options):
    """Beside everything that the recording estimates the equation gains what a scan of it gains."""
    fit = solve(test_of_one, options.model)
    share = equation_share(fit, ("accel_scale_x",))
    evidence = fit.evidence([single_equations(False)[HIDDEN]])
    assert not fit.noise_terms
    J, d = evidence.information.diagonal_given(evidence.model, evidence.weight)
    place, at = share.labels.index(HIDDEN), fit.bare.names.index("accel_scale_x")
    own, across, known = share.own[place], share.across[place, 0], share.J_told[0, 0] + fit.bare.weight[at]
    pull = share.d_told[0] + fit.bare.weight[at] * fit.bare.shift[at]
    c, r = own - across**2 / known, share.d[place] - across * pull / known
    assert c == pytest.approx(J[-1], rel=1e-6)
    assert r == pytest.approx(d[-1], rel=1e-6, abs=1e-6 * np.sqrt(c))
    assert c > 0.0


def test_an_effect_that_a_recording_lacks_says_nothing(test_of_one, options):
    share = equation_share(solve(test_of_one, options.model), ("accel_scale_x", "accel_size_x"))
    assert not share.J_told[1].any()
    assert not share.across[:, 1].any()
    assert share.d_told[1] == 0.0


def test_a_set_tells_an_equation_in_the_place_of_wrong_effects(options):
    """Without equations five effects of the gyros are told for certain here, and none of them is there."""
    plans = [short("kim18_signed", 18, 60.0), short("recommended", 18, 60.0), short("kim18_signed", 18, 60.0)]
    found = diagnose_set(unit_set(9302, plans, (f"{HIDDEN}=80 ug/g^3",)).members, options, here)
    assert [f.label for f in found.findings] == [HIDDEN]
    assert found.verdict == Verdict.OWN_EQUATION
    assert found.sentence.startswith("No effect of the catalogue fits, an equation does. Missing for certain")
    one = found.findings[0]
    assert abs(one.value - 80.0 * 9.80665e-6) < 4.0 * one.sigma
    assert [a.about for a in found.advice if a.about] == [(HIDDEN,)]


def test_another_process_finds_an_equation_by_its_label():
    """What a job names is plain text, so that processes of a set work on it; it is the same equation there."""
    one = single_equations(has_temperature=True)[HIDDEN]
    assert name_of_candidate(one) == HIDDEN
    assert asked(HIDDEN) is one
    assert name_of_candidate(asked("accel_quadratic_x")) == "accel_quadratic_x"
    own = replace(one, name="mine", parameters=(replace(one.parameters[0], name="mine"),))
    assert name_of_candidate(own) is own
