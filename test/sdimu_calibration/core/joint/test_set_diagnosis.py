"""What a set advises to record next: a turn where one tells, else a whole plan."""

from __future__ import annotations

import math

import pytest

from sdimu_calibration.core.advice import Advice, Kind
from sdimu_calibration.core.joint.set_diagnosis import _advice
from sdimu_calibration.core.plan import Turn
from sdimu_calibration.core.plan_search import NextTurn
from sdimu_calibration.core.verdict import Verdict
from sdimu_calibration.storage.files.advice_words import sentence


@pytest.mark.parametrize(
    ("after", "begins"),
    [
        (1.6, "No single turn tells a from b (the best one reaches 1.6 sigma, 3 are needed)."),
        (4.0, "To tell a from b, record once more: rests of 100 s, and between them turn X +180 deg at 10 deg/s"),
    ],
    ids=["too little", "enough"],
)
def test_a_turn_is_advised_where_it_tells(after, begins):
    turn = NextTurn((Turn("X", math.pi, math.radians(10.0)),), 2.0, 1.5, after)
    told, plan = _advice(Verdict.ONE_EFFECT, (), [(("a", "b"), turn)], ())
    assert sentence(told).startswith(begins)
    assert sentence(plan).endswith(": sdimu plan --after.")


@pytest.mark.parametrize(
    "told",
    [
        Advice(Kind.RECORD_A_THIRD, ("a", "r1", "r2")),
        Advice(Kind.LOOK_AT_RECORDING, ("r1", "a")),
        Advice(Kind.NO_PLAN_TELLS, ("a", "b")),
        *(Advice(kind) for kind in (Kind.REVERSE_AND_ADD, Kind.TRY_FORCE_EQUATION, Kind.BEGIN_LATER, Kind.SOAK_MORE)),
        *(Advice(kind) for kind in (Kind.LOOK_AT_MOUNT, Kind.ONE_BY_ONE)),
    ],
    ids=lambda told: told.kind,
)
def test_advice_on_a_set_is_a_sentence(told):
    assert sentence(told)[0].isupper()
    assert sentence(told).endswith(".")
