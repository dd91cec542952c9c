"""Advice in words: effects to be told apart, each named once."""

from __future__ import annotations

from sdimu_calibration.core.advice import Advice, Kind
from sdimu_calibration.storage.files.advice_words import sentence


def test_time_constants_of_one_effect_are_named_once_and_equations_whole():
    others = (
        "gyro_bias_warm_up_y(tau=2400 s)",
        "gyro_bias_warm_up_y(tau=1200 s)",
        "gyro_y: k * (ax + ay)",
        "gyro_bias_wrap_yx",
    )
    told = sentence(Advice(Kind.TELL_APART, ((("gyro_bias_ramp_y", others),), Advice(Kind.RANK_TURNS))))
    assert "gyro_bias_ramp_y from gyro_bias_warm_up_y, gyro_y: k * (ax + ay), gyro_bias_wrap_yx: " in told
