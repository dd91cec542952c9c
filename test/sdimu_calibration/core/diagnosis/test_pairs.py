"""Two effects that nearly cancel are found together, and noise makes no pairs."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from rate_table_sim.core import TableSpecification
from sdimu_calibration.core.diagnosis.diagnose import climb
from sdimu_calibration.core.diagnosis.ground import Request, fresh_ground
from sdimu_calibration.core.diagnosis.search import FALSE_ALARM, search
from sdimu_calibration.core.estimation.prepared_test import PreparedTest
from sdimu_calibration.core.estimation.solve import solve
from sdimu_calibration.core.specification import Site
from sdimu_calibration.storage.files.config import load_imu, load_model, load_plan
from sdimu_sim.core.scenario import Scenario, generate

SITE = Site(math.radians(52.0), 0.0)
HIDDEN = {"gyro_anisoinertia_y": "-3.3e-3 s/rad", "gyro_acceleration_sensitivity_xz": "1.2e-4 s"}
"""Over twenty sigma each; in half of the draws of the mount (seed 2) they nearly cancel."""
LIMIT = 4.0
"""Score that noise reaches in a scan (1): usual."""


def fitted(seed: int, effects: dict[str, str]):
    scenario = Scenario(
        load_plan("recommended"),
        load_imu("dtg"),
        SITE,
        TableSpecification(axes=None),
        rate_hz=20.0,
        seed=seed,
        effects=tuple(f"{name}={size}" for name, size in effects.items()),
    )
    return solve(PreparedTest(generate(scenario)[0], load_imu("dtg"), SITE), load_model("baseline"), learn=False)


@pytest.mark.parametrize("seed", [2])
def test_two_effects_that_hide_each_other_are_both_named(seed):
    found = climb(fitted(seed, HIDDEN))
    assert {c.label for c in found.chosen} == set(HIDDEN)


@pytest.fixture(scope="module")
def evidence():
    fit = fitted(4, {})
    whole = fresh_ground(Request(fit, (), FALSE_ALARM), fit, (), False)
    return whole.evidence.only(whole.allowed)


def drawn(evidence, e):
    """Evidence with other measurements, and nothing known of its coefficients."""
    known = replace(evidence.information, d=evidence.W.T @ e)
    return replace(evidence, e=e, shift=np.zeros(len(evidence.shift)), worked_out=known)


def test_noise_makes_no_pairs(evidence):
    """Two of a hundred are bearable; six and more are chance in one trial of sixty."""
    rng = np.random.default_rng(7)
    columns = np.arange(len(evidence.weight), len(evidence.names))
    told = [
        len(search(drawn(evidence, rng.standard_normal(len(evidence.e))), columns, limit=LIMIT).chosen)
        for _ in range(100)
    ]
    assert sum(count > 1 for count in told) < 6
    assert sum(count > 0 for count in told) < 6


def test_a_pair_takes_the_place_of_what_stands_for_both(evidence):
    first, second = (evidence.names.index(name) for name in HIDDEN)
    rng = np.random.default_rng(8)
    e = evidence.W[:, [first, second]] @ np.array([-3.3e-3, 1.2e-4]) + rng.standard_normal(len(evidence.e))
    columns = np.arange(len(evidence.weight), len(evidence.names))
    found = search(drawn(evidence, e), columns, limit=LIMIT)
    assert {found.evidence.names[c] for c in found.chosen} == set(HIDDEN)
