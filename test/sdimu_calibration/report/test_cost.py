"""What a missing effect costs, in metres: what the fit predicted stands beside what came out."""

from __future__ import annotations

import pytest

from sdimu_calibration.report.cost import InUse, Off


def test_what_is_wrong_without_an_effect_is_told_as_well_as_it_is_known():
    assert Off("accel_bias_z", 127.3, "ug", 35.2, 55.7).text == "accel_bias_z +127 +- 35 ug (55.7 of its sigmas)"
    assert Off("gyro_scale_y", -26.84, "ppm", 4.85, -5.5).size == "-26.8 +- 4.8 ppm"


NAMES = ("not compensated", "model as given", "with what was found")


@pytest.mark.parametrize(
    ("metres", "told"),
    [
        ((2500.0, 105.0, 40.0), "the last fit predicted 27 m"),
        ((2500.0, 40.0, 60.0), "the last fit predicted 27 m"),
        ((2500.0, 40.0, 105.0), "the last fit predicted 27 m: what was found does not hold where it was not fitted"),
        ((2500.0, 200.0, 105.0), "the last fit predicted 27 m"),
    ],
    ids=["better", "worse by chance", "worse than chance", "better than before"],
)
def test_metres_are_told_beside_what_the_last_fit_predicted(metres, told):
    assert InUse(10.0, 2, NAMES, metres, 27.0).words.endswith(f"with what was found; {told}")


def test_what_was_found_is_held_against_the_model_as_given():
    """Not against that with one effect less, which holds most of what was found."""
    grown = (*NAMES[:2], "+ an effect", NAMES[2])
    assert not InUse(10.0, 2, grown, (2500.0, 200.0, 30.0, 105.0), 27.0).fails
    assert InUse(10.0, 2, grown, (2500.0, 40.0, 200.0, 105.0), 27.0).fails


def test_a_model_that_lacks_nothing_is_not_said_to_fail():
    assert InUse(10.0, 1, NAMES[:2], (2500.0, 500.0), 27.0).words.endswith(
        "model as given; the last fit predicted 27 m"
    )


def test_nothing_is_said_where_no_fit_predicts():
    assert InUse(10.0, 1, NAMES[:1], (2500.0,)).words.endswith("seen: not compensated")


def test_each_distance_stands_beside_its_compensation():
    """A list of three numbers and a list of three names behind it had to be read twice."""
    told = InUse(10.0, 2, NAMES, (2500.0, 105.0, 40.0), 27.0).sentence
    assert told == (
        "2.5 km (not compensated) -> 105 m (model as given) -> 40 m (with what was found): position after 10 min "
        "without aid, over 2 stretches (root mean square) that no fit has seen; the last fit predicted 27 m"
    )
