"""What a running test asks: an answer that goes through a pipe, by the angles of the table; an end after a search."""

import math
import pickle
from dataclasses import replace
from types import SimpleNamespace

import pytest

from sdimu_calibration.core.adaptive import Goals, Menu, fitted, question
from sdimu_calibration.core.adaptive.knowledge import _decided
from sdimu_calibration.core.adaptive.question import Situation, next_move
from sdimu_calibration.core.diagnosis.live_diagnosis import LiveDiagnosis
from sdimu_calibration.core.verdict import Verdict
from sdimu_calibration.storage.files.goal_file import load_goals
from sdimu_calibration.storage.files.table_file import load_rate_table

from .conftest import part, perfect_fit

GOALS = load_goals("table33")
TABLE = load_rate_table("ideal")


def asked(goals: Goals, *angles: float) -> Situation:
    return Situation(goals, Menu(), TABLE, angles or (0.0, 0.0, 0.0), 60.0)


def consistent(minutes: float) -> LiveDiagnosis:
    return LiveDiagnosis(0, 60.0 * minutes, "consistent", "")


def test_a_decision_is_a_step_with_its_reason_and_survives_the_pipe(first_stop):
    decision = next_move(first_stop, consistent(0.3), asked(GOALS))
    assert pickle.loads(pickle.dumps(decision)) == decision
    assert decision.step is not None
    assert decision.reason in decision.text
    assert decision.worst > 1.0


def test_no_turn_is_chosen_for_which_no_gimbal_is_along_the_axis():
    fit, eighth = perfect_fit(part(2)), math.pi / 4.0
    free = next_move(fit, consistent(0.8), asked(GOALS))
    # With middle and inner axis at 45 deg the inner one alone is along an axis of the platform.
    stuck = next_move(fit, consistent(0.8), asked(GOALS, 0.0, eighth, eighth))
    assert free.step.turn.axis in {"Y", "Z"}
    assert stuck.step.turn is None or stuck.step.turn.axis == "X"


def test_the_time_counts_from_the_start_of_the_test_and_not_of_the_recording(first_stop):
    goes_on = next_move(first_stop, consistent(GOALS.minutes), asked(GOALS))
    assert goes_on.step is not None
    late = replace(asked(GOALS), elapsed_s=60.0 * GOALS.minutes)
    decision = next_move(first_stop, consistent(0.3), late)
    assert decision.step is None
    assert not decision.reached
    assert "time is up" in decision.text


def test_an_end_is_reached_only_after_a_search(monkeypatch):
    fit = perfect_fit(part(5))
    wide = Goals("wide", dict.fromkeys(GOALS.limits, 1e3), 30.0)
    searched = []
    # A search on samples without noise ends nowhere; what it would find is nothing.
    monkeypatch.setattr(question, "climb", searched.append)
    monkeypatch.setattr(question, "knowledge", lambda _, goals: fitted(fit, goals))
    decision = next_move(fit, consistent(2.0), asked(wide))
    assert decision.reached
    assert searched == [fit]


@pytest.mark.parametrize(
    ("verdict", "of_family", "alike", "scope", "sure"),
    [
        (Verdict.ONE_EFFECT, 0.96, (), "unit", True),
        (Verdict.SEVERAL_EFFECTS, 0.96, (), "unit", True),
        (Verdict.SEVERAL_EFFECTS, 0.94, (), "unit", False),
        (Verdict.SEVERAL_EFFECTS, float("nan"), (), "unit", False),
        (Verdict.SEVERAL_EFFECTS, 0.96, ("other",), "unit", False),
        (Verdict.SEVERAL_EFFECTS, 0.96, (), "recording", False),
        (Verdict.UNEXPLAINED, 0.96, (), "unit", False),
        (Verdict.OWN_EQUATION, 0.96, (), "unit", False),
    ],
)
def test_an_effect_is_decided_by_itself_under_a_verdict_that_stands_by_it(verdict, of_family, alike, scope, sure):
    """What is decided goes into the model of the result: nothing that was only tried, or is open, or of no sensor."""
    candidate = SimpleNamespace(label="an effect", effect=SimpleNamespace(scope=scope))
    one = SimpleNamespace(candidate=candidate, of_family=of_family, alike=alike)
    found = SimpleNamespace(verdict=verdict, found_effects=(one,))
    assert _decided(found) == (("an effect",) if sure else ())
