"""What the data leave open is closed by the turn that the covariance says, with what it is expected to reach."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sdimu_calibration.core.advice import Kind, Verb
from sdimu_calibration.core.diagnosis.closing import closing_advice, next_recording
from sdimu_calibration.core.evidence.known import Known, Standing, data_information
from sdimu_calibration.core.plan_search import Question
from sdimu_calibration.core.plan_search.bound import bounds
from sdimu_calibration.storage.files.config import load_imu, load_plan, load_site
from sdimu_calibration.storage.files.model_choice import named_model

OPEN = ("gyro_scale_asymmetry_y", "gyro_scale_quadratic_y")
ASKED = Question(load_site("daejeon"), load_imu("dtg"), named_model("baseline", ()))
SIZE = {"gyro_scale_asymmetry_y": 40e-6}


@pytest.fixture(scope="module")
def standing() -> Standing:
    """What a test knows that turned at one rate in both senses."""
    told = bounds(load_plan("kim18_signed"), replace(ASKED, model=named_model("baseline", OPEN)))
    J = data_information(told.covariance, told.prior) / np.outer(told.prior, told.prior)
    return Standing(Known(told.names, J, told.prior, np.zeros(len(told.prior))), OPEN, (OPEN,))


def test_a_class_is_closed_by_a_turn_about_its_axis_at_another_rate(standing):
    ((members, turn),) = next_recording(standing, ASKED, SIZE)
    assert members == OPEN
    assert {one.axis for one in turn.turns} == {"Y"}
    assert max(one.rate_rad_s for one in turn.turns) == pytest.approx(np.radians(10.0))
    assert turn.before < 3.0 < turn.after
    told, plan = closing_advice([(members, turn)])
    assert (told.kind, told.verb) == (Kind.RECORD_ONCE_MORE, None)
    assert (plan.kind, plan.verb) == (Kind.PLAN_NEXT, Verb.CONTINUE)
    assert told.arguments == (OPEN[0], (OPEN[1],), 100.0, turn.text)


def test_a_small_effect_is_told_apart_by_less(standing):
    """Significance goes with the size: of a twentieth no single turn tells."""
    (large,) = next_recording(standing, ASKED, SIZE)
    (small,) = next_recording(standing, ASKED, {name: 0.05 * size for name, size in SIZE.items()})
    assert small[1].after == pytest.approx(0.05 * large[1].after)
    assert [one.kind for one in closing_advice([small])] == [Kind.NO_TURN_TELLS, Kind.PLAN_NEXT]


def test_the_command_of_a_whole_plan_stands_once_for_all_classes(standing):
    (one,) = next_recording(standing, ASKED, SIZE)
    assert [told.verb for told in closing_advice([one, one])] == [None, None, Verb.CONTINUE]
    assert closing_advice([]) == []


def test_a_class_with_an_equation_is_passed_over(standing):
    odd = replace(standing, open=((OPEN[0], "gyro_y: sin(2 wy)"), OPEN))
    assert [members for members, _ in next_recording(odd, ASKED, SIZE)] == [OPEN]
