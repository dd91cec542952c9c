"""A diagnosis in the terminal: what it costs, whose probability a row has, sizes of both triads, the steps."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sdimu_calibration.cli.console import plain
from sdimu_calibration.cli.diagnosis_text import (
    CANDIDATE_HEADINGS,
    candidate_rows,
    cost_lines,
    print_out_of_sight,
    print_summary,
    smallest,
    step_lines,
    taken_for_granted,
)
from sdimu_calibration.cli.next_commands import Asked
from sdimu_calibration.core.diagnosis.assumed import Assumed
from sdimu_calibration.core.diagnosis.diagnose import Diagnosis
from sdimu_calibration.core.diagnosis.step import Step
from sdimu_calibration.core.diagnosis.summary import DiagnosisSummary, summarise
from sdimu_calibration.core.evidence.held_out import HeldOut
from sdimu_calibration.core.posterior.told import Share
from sdimu_calibration.core.units import to_si
from sdimu_calibration.report import sections
from sdimu_calibration.report.cost import coefficients_off, wrong_without


@pytest.fixture(scope="module")
def summary(diagnosis: Diagnosis) -> DiagnosisSummary:
    return summarise(diagnosis)


def step(label, moved):
    told = HeldOut(np.arange(3), np.zeros(3), 1.0)
    return Step(label, label, "1", "ppm", 9.0, 4.0, 1.0, 0.1, 50.0, 40.0, told, told, 30.0, 10.0, (), moved)


def test_each_step_says_what_it_adds():
    first, second = step_lines([step("a", (("gyro_bias_x", 4.2), ("gyro_bias_y", 0.3))), step("b", ())])
    assert first.startswith("step 1: a (z +9.0, threshold 4.0, log Bayes factor 40; log score of stops left out +30")
    assert second.startswith("step 2: b ")


def test_no_steps_are_no_lines():
    assert step_lines([]) == []


def test_the_row_of_a_member_has_its_own_probability_and_the_others_have_rows_of_their_own(summary):
    (one,) = summary.candidates
    own = one.candidate.coefficient
    open_ = replace(one, may_be=(Share(own, 0.82), Share("accel_cubic_x", 0.17), Share("accel_scale_x", 0.01)))
    rows = candidate_rows(open_, None)
    assert [row[0] for row in rows] == [one.candidate.label, "  or accel_cubic_x"]
    assert [row[CANDIDATE_HEADINGS.index("probability")] for row in rows] == ["82 %", "17 %"]


def test_smallest_sizes_are_told_of_gyros_and_of_accelerometers_without_exponents(summary):
    told = smallest(summary.reached)
    assert "gyro_" in told
    assert "accel_" in told
    assert "e+" not in told


def test_metres_and_the_worst_coefficient_are_told_before_the_held_out_error(summary, more, capsys):
    print_summary(plain(width=100), summary, Asked((Path("bag"),), (), (), Path("o")), more)
    lines = capsys.readouterr().out.splitlines()
    metres, wrong, held_out = (
        next(k for k, line in enumerate(lines) if words in line)
        for words in ("min without aid", "wrong without it: ", "held-out error")
    )
    assert 0 < metres < wrong < held_out
    assert cost_lines(summary, more)[-1].endswith("+-: one sigma over all models that the data leave open")
    for gone in ("explains", "p of the model", "a third at a time"):
        assert not any(gone in line for line in lines)


def test_coefficients_are_wrong_by_what_a_calibration_delivers(summary, more):
    """Noise that was learned without the effect widens sigmas: `compare` tells the same figure of the two results."""
    given = replace(summary.diagnosis.before, covariance=9.0 * summary.diagnosis.before.covariance)
    delivered = wrong_without(summary, replace(more, given=given))
    assert delivered == coefficients_off(given, summary.diagnosis.after)
    assert abs(delivered[0].sigmas) < abs(wrong_without(summary, replace(more, given=None))[0].sigmas)


def test_what_is_taken_as_absent_is_told_with_what_it_would_do():
    """ "No X (68 ug of it, Z is off by 154 sigma)" read as if X were there and Z were off."""
    one = Assumed(
        "accel_scale_z", "reference_gravity", "reference_gravity", to_si(66.8, "mgal"), "m/s^2", "mgal", 153.6
    )
    assert taken_for_granted([one, replace(one, coefficient="accel_scale_x", sigmas=96.0)]) == (
        "if reference_gravity were 66.8 mgal, accel_scale_z would be wrong by 154 sigma"
    )


def test_terminal_and_page_say_what_they_count_as_unseen_and_at_which_size(summary, capsys):
    """9 of 612 candidates at any size here, and 22 of 57 effects at the usual size there, read as one thing."""
    hidden = [one for one in summary.reached if not one.testable]
    print_out_of_sight(plain(), summary)
    told = " ".join(capsys.readouterr().out.split())
    never = "could not have been seen even at 30 times their usual size"
    assert (
        f"{len(hidden)} of {len(summary.reached)} candidates (each axis and time of an effect counts) {never}" in told
    )
    page = sections.smallest(summary.reached, summary.assumed, summary.untestable)
    families = len({one.family for one in hidden})
    assert "have an axis on which they could not have been seen at their usual size" in page
    assert f", {families} of these one on which they {never}." in page
