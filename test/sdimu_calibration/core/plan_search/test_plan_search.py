"""A plan that is found keeps its promises, and any table can run it that runs the one it began with."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sdimu_calibration.core.plan import Plan, Turn
from sdimu_calibration.core.plan_search import Goal, NextTurn, Question, next_turn, search
from sdimu_calibration.core.plan_search.bound import bounds
from sdimu_calibration.core.plan_search.moves import Abilities, single, whole
from sdimu_calibration.core.plan_search.search import within
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.rotation import rotation_matrix
from sdimu_calibration.storage.files.config import load_imu, load_model, load_plan, load_site
from sdimu_calibration.storage.files.plan_file import write_plan

ASKED = Question(load_site("daejeon"), load_imu("dtg"), load_model("baseline"))
ABLE = Abilities((math.radians(2.0), math.radians(10.0)), math.radians(20.0), (20.0, 40.0, 60.0, 100.0))
KIM18 = load_plan("kim18")


def attitudes(plan: Plan) -> list[np.ndarray]:
    """Attitude of the table at every stop."""
    out = [np.eye(3)]
    for turn in plan.turns:
        out.append(out[-1] @ rotation_matrix(turn.angle_rad * np.eye(3)["XYZ".index(turn.axis)]))
    return out


@pytest.mark.parametrize(
    ("before", "after", "words"),
    [
        (0.0, 12.34, "apart by 12.3 sigma instead of 0.0"),
        (0.0, 0.0, "apart by 0.0 sigma with it and without: nothing changes"),
        (5.0, 5.00001, "apart by 5.0 sigma with it and without: nothing changes"),
        (0.01, 0.04, "apart by 0.04 sigma instead of 0.01"),
        (5.001, 5.003, "apart by 5.003 sigma instead of 5.001"),
    ],
)
def test_a_turn_says_what_it_changes_in_digits_that_show_it(before, after, words):
    turn = NextTurn((Turn("Y", math.pi, math.radians(10.0)),), 4.0, before, after)
    assert turn.text == f"turn Y +180 deg at 10 deg/s (4.0 min): {words}"


def test_a_plan_without_turns_is_no_plan_to_begin_with():
    still = replace(KIM18, name="still", dwell_s=KIM18.dwell_s[:1], turns=())
    with pytest.raises(DataError, match="still: a search changes the turns of a plan, and this one has none"):
        search(still, ASKED, ABLE, Goal({}, 10.0), 1)


@pytest.mark.parametrize("moves", [whole, single])
def test_every_change_ends_at_the_same_attitude_and_stops_nowhere_new_but_half_way(moves):
    known = attitudes(KIM18)
    found = moves(KIM18, ABLE)
    for changed in found if moves is single else (plan for plans in found for plan in plans):
        assert len(changed.dwell_s) == len(changed.turns) + 1
        stops = attitudes(changed)
        np.testing.assert_allclose(stops[-1], known[-1], atol=1e-9)
        new = [C for C in stops if min(np.abs(C - K).max() for K in known) > 1e-9]
        assert len(new) <= 1


def test_a_shorter_plan_is_found_that_keeps_the_limits():
    limits = {effect: 1.2 * sigma for effect, sigma in bounds(KIM18, ASKED).largest().items()}
    found = search(KIM18, ASKED, ABLE, Goal(limits), tries=6)
    assert found.minutes < 0.9 * KIM18.duration_s / 60.0
    told = bounds(found.plan, ASKED).largest()
    assert all(told[effect] <= limit * (1.0 + 1e-5) for effect, limit in limits.items())
    assert found.tried <= 6


@pytest.mark.parametrize("minutes", [35.0, 20.0])
def test_a_plan_keeps_to_the_time_given_however_few_are_tried(minutes):
    found = search(KIM18, ASKED, ABLE, Goal({}, minutes), tries=1)
    assert found.minutes <= minutes
    # All of it is used that stops of one length can use.
    assert found.minutes > 0.8 * minutes


def test_a_plan_is_shortened_as_far_as_its_attitudes_allow():
    slow = Abilities((math.radians(2.0),), math.radians(20.0), (100.0,))
    crossed = replace(KIM18, dwell_s=(100.0,) * 3, turns=(KIM18.turns[0], replace(KIM18.turns[0], axis="Z")))
    assert within(crossed, slow, 1.0) is crossed
    quick = replace(slow, rates_rad_s=(math.radians(2.0), math.radians(10.0)), dwells_s=(20.0, 100.0))
    assert within(crossed, quick, 1.0).duration_s == pytest.approx(60.0 + crossed.turns[0].duration_s * 0.4)
    assert within(crossed, quick, 60.0) is crossed
    # A turn that the table cannot run is no way to save time.
    weak = replace(quick, acceleration_rad_s2=1e-5)
    assert {turn.rate_rad_s for turn in within(crossed, weak, 1.0).turns} == {KIM18.turns[0].rate_rad_s}


def test_in_a_given_time_the_worst_sigma_gets_smaller():
    limits = bounds(KIM18, ASKED).largest()
    minutes = 31.0
    found = search(KIM18, ASKED, ABLE, Goal(limits, minutes), tries=6)
    assert found.minutes <= minutes
    quick = replace(KIM18, dwell_s=(40.0,) * 19)
    assert quick.duration_s / 60.0 <= minutes
    told = bounds(quick, ASKED).largest()
    assert found.worst < max(told[e] / limits[e] for e in limits)


def test_a_limit_on_what_is_not_estimated_is_refused():
    with pytest.raises(DataError, match="accel_quadratic"):
        search(KIM18, ASKED, ABLE, Goal({"accel_quadratic": 1.0}), tries=1)


def test_asymmetry_and_quadratic_term_are_told_apart_by_another_rate_about_their_axis():
    short = Plan(
        "short",
        (60.0,) * 4,
        (
            Turn("Y", math.pi, math.radians(2.0)),
            Turn("Y", -math.pi, math.radians(2.0)),
            Turn("Z", 0.5 * math.pi, math.radians(2.0)),
        ),
        math.radians(1.0),
    )
    ranked = next_turn(short, ASKED, ("gyro_scale_asymmetry_y", "gyro_scale_quadratic_y"))
    best = ranked[0]
    assert {turn.axis for turn in best.turns} == {"Y"}
    assert best.turns[0].rate_rad_s == pytest.approx(math.radians(10.0))
    assert best.after > 5.0 * best.before
    # More data never tell less.
    assert all(one.after > one.before * (1.0 - 1e-3) for one in ranked)
    # One rate more of the same does next to nothing.
    same = [one for one in ranked if all(t.rate_rad_s < math.radians(3.0) for t in one.turns)]
    assert max(one.after for one in same) < 0.3 * best.after


def test_one_coefficient_alone_is_nothing_to_tell_apart():
    with pytest.raises(DataError, match="two coefficients"):
        next_turn(KIM18, ASKED, ("gyro_scale_asymmetry_y",))


def test_a_plan_written_is_the_plan_read(tmp_path: Path):
    for changed in list(single(KIM18, ABLE))[::5]:
        write_plan(tmp_path / "found.yaml", changed, ["by a test"])
        read = load_plan(tmp_path / "found.yaml")
        assert read.dwell_s == changed.dwell_s
        assert [t.axis for t in read.turns] == [t.axis for t in changed.turns]
        np.testing.assert_allclose([t.angle_rad for t in read.turns], [t.angle_rad for t in changed.turns], rtol=1e-9)
        np.testing.assert_allclose([t.rate_rad_s for t in read.turns], [t.rate_rad_s for t in changed.turns], rtol=1e-9)
