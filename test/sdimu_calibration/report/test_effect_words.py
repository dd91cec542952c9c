"""Effects in words: what is in brackets stands apart from the axis."""

from sdimu_calibration.core.diagnosis.found import Found
from sdimu_calibration.core.effects.selection import resolve
from sdimu_calibration.core.evidence.candidate import Candidate
from sdimu_calibration.report.effect_words import family_words, title_of

EFFECT = resolve("gyro_bias_warm_up_y(tau=1200 s)")


def test_a_time_constant_stands_behind_a_space():
    assert title_of("gyro_bias_warm_up_y(tau=1200 s)") == f"{EFFECT.title} (tau=1200 s)"
    assert title_of("gyro_scale") == resolve("gyro_scale").title


def test_an_axis_and_a_time_constant_stand_apart():
    candidate = Candidate(EFFECT, "gyro_bias_warm_up", "gyro_bias_warm_up_y(tau=1200 s)")
    found = Found.__new__(Found)
    object.__setattr__(found, "candidate", candidate)
    assert f"{EFFECT.title}, y (tau=1200 s)" in family_words([found])
