"""Dwells without a status are found where a wide specification would let turns pass, and only there."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sdimu_calibration.core.data.dwell_detection import GrowingDwells, detected_dwells, with_detected_dwells
from sdimu_calibration.core.data.phases import rest_limits
from sdimu_calibration.core.plan import Plan
from sdimu_calibration.core.recording import Recording
from sdimu_calibration.storage.files.config import load_imu, load_plan, load_site
from sdimu_sim.core.scenario import Scenario, generate

MEMS, DTG, KIM18 = load_imu("mems_industrial"), load_imu("dtg"), load_plan("kim18")
HURRIED = Plan("kim18, short dwells", (20.0,) * len(KIM18.dwell_s), KIM18.turns, np.radians(9.0))


@pytest.mark.parametrize("seed", range(81, 85))
def test_slow_turns_of_an_imu_with_a_bias_as_large_are_found(seed):
    assert rest_limits(MEMS).rate > 0.5 * min(turn.rate_rad_s for turn in HURRIED.turns)
    r, _ = generate(Scenario(HURRIED, MEMS, load_site("daejeon"), rate_hz=20.0, seed=seed))
    found = with_detected_dwells(replace(r, phase=None), MEMS)
    assert "no status" in found.notes[-1]
    log = found.phase
    said = r.phase.dwell[np.searchsorted(r.phase.t, log.t, side="right") - 1]
    # What is called rest is rest; a window to each side of a turn is given away, and no more than a second and a half.
    assert not (log.dwell & ~said).any()
    assert (said & ~log.dwell).sum() * np.median(np.diff(log.t)) < 2 * 1.5 * len(HURRIED.turns)
    assert len(np.unique(log.stop[log.dwell])) == len(HURRIED.dwell_s)


@pytest.mark.parametrize("seed", range(87, 91))
@pytest.mark.parametrize("rate_deg_s", [2.0, 5.0, 10.0])
def test_turns_that_begin_and_end_softly_are_turns_from_the_beginning(seed, rate_deg_s):
    """S-curves, at their means of `rate_deg_s`: what a table turns in what is called rest is nothing that is seen."""
    rng, interval = np.random.default_rng(seed), 0.05
    turn, rest = 270.0 / rate_deg_s, 40.0 + rng.random()
    n = round((3 * rest + 2 * turn) / interval)
    t = interval * np.arange(1, n + 1)
    rate = np.zeros(n)
    for begin in (rest, 2 * rest + turn):
        inside = (t > begin) & (t <= begin + turn)
        rate[inside] = np.radians(rate_deg_s) * (1.0 - np.cos(2.0 * np.pi * (t[inside] - begin) / turn))
    w = np.stack([np.zeros(n), rate, np.zeros(n)], axis=1) + MEMS.gyro_white_noise / np.sqrt(interval) * (
        rng.standard_normal((n, 3))
    )
    angle = np.cumsum(rate) * interval
    f = 9.8 * np.stack([-np.sin(angle), np.zeros(n), np.cos(angle)], axis=1)
    log = detected_dwells(Recording(0, t, w, f))
    at_rest = log.dwell[np.clip(np.searchsorted(log.t, t, side="right") - 1, 0, None)]
    assert len(np.unique(log.stop[log.dwell])) == 3
    assert np.degrees(rate[at_rest].sum()) * interval * 3600.0 < 1.0
    assert (at_rest & (rate == 0.0)).sum() * interval > 3 * 25.0


def test_a_specification_that_tells_rest_and_a_status_are_left_alone():
    r, _ = generate(Scenario(HURRIED, DTG, load_site("daejeon"), rate_hz=20.0, seed=85))
    assert with_detected_dwells(r, MEMS) is r
    silent = replace(r, phase=None)
    assert with_detected_dwells(silent, DTG) is silent


def test_an_imu_that_never_rests_has_no_dwells():
    rng = np.random.default_rng(86)
    r, _ = generate(Scenario(HURRIED, DTG, load_site("daejeon"), rate_hz=20.0, seed=86))
    phase = 2.0 * np.pi * r.t[:, None] * [0.31, 0.47, 0.53] + rng.uniform(0.0, 6.0, 3)
    assert detected_dwells(replace(r, omega_ib_b=np.sin(phase), phase=None)) is None


@pytest.mark.parametrize(("seed", "block_s"), [(81, 1.0), (82, 7.3)])
def test_a_test_that_goes_on_knows_its_dwells_a_few_seconds_later(seed, block_s):
    r, _ = generate(Scenario(HURRIED, MEMS, load_site("daejeon"), rate_hz=20.0, seed=seed))
    growing, decided, found, at = GrowingDwells(0.05), 0.0, [], 0
    for until in np.arange(block_s, r.t[-1], block_s):
        rows = slice(at, int(np.searchsorted(r.t, until + 1e-9)))
        at = rows.stop
        growing.add(r.t[rows], r.omega_ib_b[rows], r.f_ib_b[rows])
        log, limit = growing.log()
        assert until - 4.0 < limit <= until or until < 4.0
        if log is not None and limit > decided:
            now = (log.t >= decided) & (log.t < limit)
            found += list(zip(log.t[now], log.dwell[now], strict=True))
            decided = limit
    t, dwell = map(np.array, zip(*found, strict=True))
    assert (np.diff(t) > 0.0).all()
    said = r.phase.dwell[np.searchsorted(r.phase.t, t, side="right") - 1]
    # What is called rest is rest; to each side of a turn a window is given away, and the seconds it takes to decide.
    assert not (dwell & ~said).any()
    assert (said & ~dwell).sum() * np.median(np.diff(t)) < 2 * 1.5 * len(HURRIED.turns)
