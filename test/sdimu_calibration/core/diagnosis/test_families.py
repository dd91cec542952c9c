"""One cause that moves several axes is sought and told as one."""

from __future__ import annotations

from sdimu_calibration.core.diagnosis.diagnose import climb

TURNED = ("accel_triad_ramp_x=25 arcsec/h", "accel_triad_ramp_y=-30 arcsec/h")


def test_an_effect_that_is_not_to_be_tried_is_not_named_and_something_is_missing_all_the_same(bench):
    found = climb(bench.fit(7, TURNED), without=("accel_triad_ramp",))
    assert not any(c.family == "accel_triad_ramp" for c in found.chosen)
    assert found.verdict != "consistent"


def test_a_triad_that_turns_is_told_as_one_effect_on_two_axes(bench):
    found = bench.diagnosis(7, TURNED)
    assert {c.label for c in found.chosen} == {"accel_triad_ramp_x", "accel_triad_ramp_y"}
    words, sizes = "turn of the accelerometer triad", found.sentence.count(" arcsec/h)")
    assert found.sentence.startswith("Certain: ")
    assert found.sentence.count(words) == sizes == 2


def test_a_delay_of_a_gyro_and_its_sensitivity_to_angular_acceleration_are_one_find(bench):
    """``w(t - tau) = w - tau dw/dt``: no data tell them apart, so one is told, and the other as what it may be."""
    found = bench.diagnosis(3, ("gyro_delay_x=0.15 ms",), "recommended")
    names = {"gyro_delay_x", "gyro_acceleration_sensitivity_xx"}
    (told,) = [c for c in found.chosen if c.coefficient in names]
    probability, shares = found.may_be(int(found.found.chosen[list(found.chosen).index(told)]))
    assert probability > 0.95
    assert names <= {share.name for share in shares}
    assert sum(share.probability for share in shares if share.name in names) <= 1.0 + 1e-9
