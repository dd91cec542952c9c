"""Advice as Python gives it: calls that can be pasted, and no option of a shell."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import pytest
from plans import quick_plan

import sdimu_calibration as sdimu
from sdimu_calibration.api import diagnosis as diagnosis_in_python
from sdimu_calibration.api.advice_in_python import IN_PYTHON_OF_A_SET, in_python
from sdimu_calibration.api.diagnosis import FitDiagnosis
from sdimu_calibration.api.fit import CalibrationFit
from sdimu_calibration.core.advice import Advice, Kind, Verb
from sdimu_calibration.core.diagnosis.summary import summarise
from sdimu_calibration.core.estimation.solve import solve
from sdimu_calibration.core.plan_search import NextTurn
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.storage.files.advice_words import sentence
from sdimu_calibration.storage.files.config import find_config, load_plan

ABOUT = {
    Verb.ADD: ("accel_quadratic_x", "bias(tau=3 s)"),
    Verb.DIAGNOSE: (),
    Verb.REVERSE_PLAN: (),
    Verb.RANK_TURNS: ("gyro_scale_asymmetry_y", "gyro_scale_quadratic_y"),
    Verb.LEAVE_OUT: ("66.5-66.8",),
    Verb.CONTINUE: (),
}

FEW = replace(quick_plan(), dwell_s=quick_plan().dwell_s[:4], turns=quick_plan().turns[:3])
"""Another plan than the one of the recording: a turn after each plan is foreseen 27 times."""


@pytest.fixture
def fit(diagnosis):
    return CalibrationFit(diagnosis.fit)


@pytest.fixture
def found(diagnosis):
    return FitDiagnosis(diagnosis)


@pytest.mark.parametrize("verb", ABOUT)
@pytest.mark.parametrize("speech", [in_python(True), IN_PYTHON_OF_A_SET], ids=["recording", "set"])
def test_each_call_is_python(verb, speech):
    call = speech.command(Advice(Kind.KEEP, ("it",), verb, ABOUT[verb]))
    if speech is IN_PYTHON_OF_A_SET and verb in (Verb.REVERSE_PLAN, Verb.RANK_TURNS):
        # A set has neither a plan nor turns.
        assert call.startswith("in a shell, sdimu plan --plan PLAN ")
    else:
        compile(call, "advice", "eval")
        assert "--" not in call


@pytest.mark.parametrize("kind", [Kind.RECORD_MORE, Kind.ONE_BY_ONE, Kind.RECORD_IN_OTHER_ORDER])
def test_words_in_the_middle_are_python_too(kind):
    said = sentence(Advice(kind), in_python(True))
    (call,) = re.findall(r"\((sdimu\..*)\)[.:,]", said)
    compile(call, "advice", "eval")
    assert "sdimu diagnose" in sentence(Advice(kind))


def test_what_is_advised_can_be_run(fit, found):
    (call,) = (text.rpartition(": ")[2].rstrip(".") for text in found.advice if "fit.add(" in text)
    better = eval(call, {"fit": fit})
    assert len(better.names) > len(fit.names)


def test_turns_are_ranked_after_the_plan_that_was_seen(found):
    assert [turn.axis for turn in found.plan.turns] == [turn.axis for turn in reversed(found.plan.backwards().turns)]
    ranked = found.turns("gyro_scale_asymmetry_y", "gyro_scale_quadratic_y")
    assert ranked[0].gain == max(one.gain for one in ranked)
    assert ranked[0].after >= ranked[0].before
    # After another plan they tell something else.
    other = found.turns("gyro_scale_asymmetry_y", "gyro_scale_quadratic_y", plan=FEW)
    assert other[0].before != pytest.approx(ranked[0].before, rel=1e-3)


def test_where_no_plan_was_seen_the_user_states_it(diagnosis):
    summary = summarise(diagnosis)
    crossed = replace(summary.plan.turns[0], axis=None)
    found = FitDiagnosis(diagnosis)
    found.summary = replace(summary, plan=replace(summary.plan, turns=(crossed, *summary.plan.turns[1:])))
    for ask in (lambda: found.plan, lambda: found.turns("gyro_scale_asymmetry_y", "gyro_scale_quadratic_y")):
        with pytest.raises(DataError, match=r'several axes.*found\.turns\(\.\.\., plan="PLAN"\)'):
            ask()
    assert found.turns("gyro_scale_asymmetry_y", "gyro_scale_quadratic_y", plan=FEW)
    assert "found.plan" not in " ".join(found.advice)
    call = in_python(False).command(Advice(Kind.RANK_TURNS, (), Verb.RANK_TURNS, ("a", "b")))
    assert call.startswith('found.turns("a", "b", plan="PLAN") (PLAN: ')


@pytest.mark.parametrize("stated", ["kim18", Path("kim18.yaml"), str(find_config("plan", "kim18")), load_plan("kim18")])
def test_turns_take_a_plan_as_path_name_or_itself(found, stated, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "kim18.yaml").write_bytes(find_config("plan", "kim18").read_bytes())
    ranked = (NextTurn(load_plan("kim18").turns[:1], 2.0, 0.0, 5.0),)
    begun = []
    monkeypatch.setattr(diagnosis_in_python, "next_turn", lambda start, *_: begun.append(start) or ranked)
    assert found.turns("gyro_scale_asymmetry_y", "gyro_scale_quadratic_y", plan=stated) == ranked
    assert begun == [load_plan("kim18")]


@pytest.mark.parametrize(
    ("effects", "options", "said"),
    [
        ((["gyro_scale_asymmetry_y", "gyro_scale_quadratic_y"],), {}, r"turns\(...\): expected names of effects"),
        (("gyro_scale_asymmetry_y", 5), {}, r"turns\(...\): expected names of effects.*not 5"),
        (("gyro_scale_asymmetry_y", "gyro_scale_quadratic_y"), {"plan": 3}, r"turns\(plan=...\): expected.*not 3"),
        (("gyro_scale_asymmetry_y", "gyro_scale_quadratic_y"), {"plan": sdimu.plan}, "a plan, not <function plan"),
        (("gyro_scale_asymmetry_y", "gyro_scale_quadratic_y"), {"plan": Path("kim18")}, "kim18: no such plan file"),
        (
            ("gyro_bias_temperature_x", "gyro_bias_temperature_y"),
            {"plan": FEW},
            "no turn tells .* apart: a plan is foreseen at",
        ),
    ],
)
def test_turns_of_what_they_cannot_take_or_tell_are_refused_in_one_line(found, effects, options, said):
    with pytest.raises(DataError, match=said) as refused:
        found.turns(*effects, **options)
    assert "\n" not in str(refused.value)


def test_times_that_are_to_be_left_out_join_those_that_are(diagnosis):
    test = diagnosis.fit.test
    without = solve(test.without_times(((60.0, 61.0),)), diagnosis.fit.model)
    saturated = Advice(Kind.LEAVE_OUT_TIMES, ("saturated",), Verb.LEAVE_OUT, ("66.5-66.8",))
    found = FitDiagnosis(replace(diagnosis, fit=without))
    found.summary = replace(found.summary, advice=(saturated,))
    call = found.advice[0].rpartition(": ")[2].rstrip(".")
    again = eval(call, {"sdimu": sdimu, "fit": CalibrationFit(without)})
    assert again.core.fit.test.excluded == ((60.0, 61.0), (66.5, 66.8))
    assert again.core.fit.test.recording is test.recording


def test_times_of_a_recording_of_a_set_are_left_out_of_it_alone(monkeypatch):
    call = IN_PYTHON_OF_A_SET.command(Advice(Kind.LEAVE_OUT_TIMES, ("x",), Verb.LEAVE_OUT, ("66.5-66.8",)))
    given = []
    for name in ("diagnose", "calibrate"):
        monkeypatch.setattr(sdimu, name, lambda one: one)
    monkeypatch.setattr(sdimu, "open", lambda bag, **options: given.append((bag, options)))
    eval(call, {"sdimu": sdimu})
    assert given == [("BAG", {"exclude_times": [(66.5, 66.8)]})]
