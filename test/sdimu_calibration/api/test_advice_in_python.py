"""Advice as Python gives it: calls that can be pasted, and no option of a shell."""

from __future__ import annotations

import re

import pytest

from sdimu_calibration.api.advice_in_python import IN_PYTHON_OF_A_SET, in_python
from sdimu_calibration.api.diagnosis import FitDiagnosis
from sdimu_calibration.api.fit import CalibrationFit
from sdimu_calibration.core.advice import Advice, Kind, Verb
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.storage.files.advice_words import sentence

ABOUT = {
    Verb.ADD: ("accel_quadratic_x", "bias(tau=3 s)"),
    Verb.DIAGNOSE: (),
    Verb.REVERSE_PLAN: (),
    Verb.RANK_TURNS: ("gyro_scale_asymmetry_y", "gyro_scale_quadratic_y"),
    Verb.LEAVE_OUT: ("66.5-66.8",),
    Verb.CONTINUE: (),
}


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
        call = call.partition(" (PLAN")[0]
    if call.startswith("in a shell, "):
        assert "sdimu plan --plan PLAN --backwards" in call
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
    other = found.turns("gyro_scale_asymmetry_y", "gyro_scale_quadratic_y", plan="kim18")
    assert other[0].before != pytest.approx(ranked[0].before, rel=1e-3)


def test_where_no_plan_was_seen_the_user_states_it(found, monkeypatch):
    monkeypatch.setattr(type(found), "plan", None)
    with pytest.raises(DataError, match="plan="):
        found.turns("gyro_scale_asymmetry_y", "gyro_scale_quadratic_y")
    call = in_python(False).command(Advice(Kind.RANK_TURNS, (), Verb.RANK_TURNS, ("a", "b")))
    assert call.startswith('found.turns("a", "b", plan="PLAN") (PLAN: ')
