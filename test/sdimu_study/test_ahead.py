"""Whether a search missed the truth is judged by the truth's own score, in its best variant and noise."""

from __future__ import annotations

from dataclasses import replace

import pytest

from sdimu_calibration.core.posterior.noise_models import NoiseModel
from sdimu_study.ahead import MISSED, ahead

NAMES = ("accel_quadratic_z", "gyro_bias_warm_up_y")


@pytest.fixture(scope="module")
def found(two_found):
    return two_found.found.posterior


def test_what_is_found_is_no_less_likely_than_the_truth(found):
    assert ahead(found, NAMES) < MISSED


def test_a_search_that_ends_before_the_truth_missed_it(found):
    best = found.best
    stopped = replace(found, models=(replace(best, members=()), *found.models))
    _, data = found.board.data(best.noise)
    behind = data.at(best.members).score - data.at(()).score
    assert ahead(stopped, NAMES) == pytest.approx(behind + ahead(found, NAMES))
    assert ahead(stopped, NAMES) > MISSED
    # In a noise that is far behind, too.
    elsewhere = replace(found, models=(replace(best, noise=NoiseModel(), members=()), *found.models))
    assert ahead(elsewhere, NAMES) > MISSED


def test_what_cannot_be_seen_and_what_gains_nothing_is_left_out_of_the_truth(found):
    more = (*NAMES, "gyro_cubic_of_nothing", "accel_cubic_x")
    assert ahead(found, more) == pytest.approx(ahead(found, NAMES), abs=1e-9)
    assert ahead(found, ()) < -MISSED
