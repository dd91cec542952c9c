"""A live diagnosis goes through its messages whole: what is sent is what a page or a terminal sees."""

import math

import pytest

from sdimu_calibration.core.diagnosis.live_diagnosis import LiveDiagnosis, ModelError, Ranked
from sdimu_calibration.core.posterior.told import FamilyShare, MemberShare, Probabilities
from sdimu_calibration.core.verdict import Verdict
from sdimu_calibration.nodes.diagnosis_messages import diagnosis, seen_diagnosis
from sdimu_calibration.report.live_text import SeenDiagnosis

STEP = MemberShare('gyro_bias_step_y(t0=300 s; "odd")', 0.6, 1e-6, 1e-7, "rad/s", "deg/h")
WARM_UP = MemberShare("gyro_bias_warm_up_y(tau=600 s)", 0.375, 1e-6, 1e-7, "rad/s", "deg/h")
ODDS = Probabilities(0.025, (FamilyShare("gyro_bias_drift", "gyro_y", 0.975, (STEP, WARM_UP)),), ())
FOUND = LiveDiagnosis(5, 300.0, Verdict.CLASS_OF_EFFECTS, "said", ladder=(ModelError((), 2.4, 1.1),))


def test_families_keep_their_probabilities_and_members():
    message = diagnosis(10**9, LiveDiagnosis(**{**vars(FOUND), "probabilities": ODDS}))
    seen = seen_diagnosis(message, SeenDiagnosis())
    assert seen.nothing == 0.025
    (family,) = seen.families
    assert (family.name, family.probability) == ("Slow change of the bias, gyro y", 0.975)
    assert family.members == ((STEP.label, 0.6), (WARM_UP.label, 0.375))


def test_before_the_end_there_are_no_probabilities():
    before = SeenDiagnosis(nothing=0.5)
    seen = seen_diagnosis(diagnosis(10**9, FOUND), before)
    assert math.isnan(seen.nothing)
    assert seen.families == ()
    assert (seen.stop, seen.verdict, seen.ladder) == (5, "class of effects", (("as given", "2.4"),))


@pytest.mark.parametrize("verdict", list(Verdict))
def test_every_verdict_is_read_again(verdict):
    found = LiveDiagnosis(**{**vars(FOUND), "verdict": verdict})
    assert seen_diagnosis(diagnosis(10**9, found), SeenDiagnosis()).verdict == verdict


def test_a_page_knows_which_candidates_stand_out_of_the_noise():
    # Two variants of one candidate are one row of the table.
    scores = {"a_x(tau=1 s)": -9.0, "a_x(tau=2 s)": 8.0, "b_x": 3.7, "c_x": 3.66}
    ranking = tuple(Ranked(label, z, 1e-6 * z, 1e-6, "1") for label, z in scores.items())
    message = diagnosis(10**9, LiveDiagnosis(**{**vars(FOUND), "ranking": ranking, "threshold": 3.67}))
    seen = seen_diagnosis(message, SeenDiagnosis())
    assert [label for label, _ in seen.ranking] == ["a_x(tau=1 s)", "b_x", "c_x"]
    assert seen.standing == 2
