"""Candidates that are kept before a search are those that its moves bring near the best model."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import pytest

from rate_table_sim.core import TableSpecification
from sdimu_calibration.core.diagnosis import ground
from sdimu_calibration.core.diagnosis.candidates import equations, periodic
from sdimu_calibration.core.diagnosis.diagnose import climb
from sdimu_calibration.core.diagnosis.ground import Request, fresh_ground
from sdimu_calibration.core.diagnosis.search import FALSE_ALARM, search
from sdimu_calibration.core.estimation.prepared_test import PreparedTest
from sdimu_calibration.core.estimation.solve import solve
from sdimu_calibration.core.evidence.wander import Wander
from sdimu_calibration.core.posterior.board import Board
from sdimu_calibration.core.posterior.near import near
from sdimu_calibration.core.posterior.search import WINDOW
from sdimu_calibration.core.specification import Site
from sdimu_calibration.storage.files.config import load_imu, load_model, load_plan
from sdimu_sim.core.scenario import Scenario, generate

SITE = Site(math.radians(36.0), 0.0)
WAVE = "accel_z=15*ug*sin(2*pi*t/500 + 0.7)"
"""An error that no registered effect has."""
QUADRATIC = "accel_quadratic_x=30 ug/g^2"
WALK = "accel_noise_random_walk=2 ug/sqrt(h)"


@cache
def fitted(noise):
    scenario = Scenario(
        load_plan("recommended"),
        load_imu("dtg"),
        SITE,
        TableSpecification(axes=None),
        rate_hz=20.0,
        seed=3,
        effects=(WAVE, QUADRATIC),
        noise=noise,
    )
    return solve(PreparedTest(generate(scenario)[0], load_imu("dtg"), SITE), load_model("baseline"), learn=False)


@pytest.mark.parametrize("noise", [(), (WALK,)], ids=["white", "walk"])
def test_what_is_kept_is_what_a_move_brings_near_the_best_model(noise):
    fit = fitted(noise)
    both = [*equations(fit.has_temperature), *periodic(fit.timetable.duration)]
    every = [one for effect in both for one in effect.singles]
    whole = fresh_ground(Request(fit, (), FALSE_ALARM), fit, (), False)
    wander = Wander.of(whole.evidence) if noise else None
    found = search(whole.evidence, whole.allowed, wander).posterior
    assert any(one.terms for one, p in found.noises if p > 0.02) == bool(noise)
    is_near = near(found, every, found.board.evidence.signature(every))
    kept = {effect.labels[0] for effect, kept in zip(every, is_near, strict=True) if kept}

    wide = found.board.evidence.with_effects(every)
    first = len(found.board.evidence.names)
    allowed = np.append(found.board.allowed, np.arange(first, len(wide.names)))
    board = Board(wide, allowed, found.board.finer, wander).in_excess(found.board.excess)
    place = {int(column): k for k, column in enumerate(board.use)}
    added = np.array([k for column, k in place.items() if column >= first])
    members = tuple(
        (place[c], w) for c, (_, w) in zip(found.board.columns(found.best.members), found.best.members, strict=True)
    )
    best, near_ones = -math.inf, set()
    for one in [one for one, p in found.noises if p > 0.02]:
        offset, data = board.data(one)
        here = data.at(members)
        tables = [here.score + here.gains(), *(here.score + table for _, table in here.exchanges())]
        tables += [table for _, table in here.mergers()]
        best = max(best, offset + here.score)
        scores = offset + np.max(tables, axis=(0, 2))[added]
        near_ones |= {wide.names[board.use[k]] for k, score in zip(added, scores, strict=True) if score > best - WINDOW}
    assert len(near_ones) > 0
    assert near_ones <= kept
    assert len(kept) < 0.2 * len(every)


def test_a_diagnosis_tells_what_it_tells_with_all_of_them(monkeypatch):
    fit = fitted(())
    few = climb(fit)
    monkeypatch.setattr(ground, "near", lambda *three: np.ones(len(three[1]), dtype=bool))
    whole = climb(fit)
    assert few.found.passed > 0
    assert whole.found.passed == 0
    assert few.verdict == whole.verdict == "own equation"
    assert [c.label for c in few.chosen] == [c.label for c in whole.chosen]
    assert few.probabilities.nothing == pytest.approx(whole.probabilities.nothing, abs=0.01)
    shares = {(f.family, f.sensor): f.probability for f in whole.probabilities.families}
    for one in few.probabilities.families:
        assert one.probability == pytest.approx(shares.get((one.family, one.sensor), 0.0), abs=0.02)
    assert few.found.threshold == pytest.approx(whole.found.threshold, abs=0.2)
    sigma = np.sqrt(np.diag(whole.after.covariance))
    assert np.abs((few.after.values - whole.after.values) / np.where(sigma > 0, sigma, 1.0)).max() < 0.1
