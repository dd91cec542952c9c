"""What a test could have seen: sizes that a sensor may have."""

from __future__ import annotations

from dataclasses import replace
from html import escape

import numpy as np
import pytest

from sdimu_calibration.core.diagnosis import found
from sdimu_calibration.core.diagnosis.advice import untestable_by_hand, untestable_reasons
from sdimu_calibration.core.diagnosis.plan_seen import plan_seen
from sdimu_calibration.core.diagnosis.summary import summarise
from sdimu_calibration.core.evidence.testable import WORST_SENSOR
from sdimu_calibration.report import sections


@pytest.fixture(scope="module")
def priors(diagnosis):
    evidence = diagnosis.evidence.only(found.catalogue_columns(diagnosis))
    return dict(zip((one.label for one in evidence.candidates), evidence.prior.tolist(), strict=True))


def test_what_only_an_impossible_size_would_show_is_not_shown_by_the_plan(diagnosis, priors, monkeypatch):
    """A recording that hardly turns was told to show a quadratic error from 37 g/g^2 on."""
    whole = found.reach(diagnosis)
    ratio = {one.label: one.smallest / priors[one.label] for one in whole}
    assert all(ratio[one.label] <= WORST_SENSOR for one in whole if one.testable)
    some = float(np.median([ratio[one.label] for one in whole if one.testable]))
    monkeypatch.setattr(found, "WORST_SENSOR", some)
    fewer = found.reach(diagnosis)
    lost = [one for one, before in zip(fewer, whole, strict=True) if before.testable and not one.testable]
    assert lost
    assert all(ratio[one.label] > some for one in lost)


def test_what_only_an_impossible_size_would_show_is_not_said_to_be_hidden_by_the_motion_or_the_model(diagnosis):
    """Products of forces were told not to be excited, of whose signature the model leaves 96 %."""
    (square,) = [one for one in found.reach(diagnosis) if one.label == "gyro_g_squared_xx"]
    assert square.retention > 0.5
    hidden = replace(square, testable=False, partners=("gyro_bias_x",))
    gone = replace(hidden, retention=0.001)
    for told, other in (
        (untestable_reasons((hidden, gone), plan_seen(diagnosis.evidence)), "coefficients of the model take it"),
        (untestable_by_hand((hidden, gone)), "the motion of this run does not excite it"),
    ):
        assert [one.reason for one in told] == ["at no size that a sensor has does it stand out of the noise", other]


def test_the_page_states_no_impossible_size(diagnosis):
    entry = next(one for one in found.reach(diagnosis) if np.isfinite(one.smallest) and np.isfinite(one.prior))
    huge = replace(entry, smallest=1.01 * WORST_SENSOR * entry.prior)
    assert sections._seen(huge, {})[1] == ""
    assert sections._seen(huge, {huge.label: "the plan does not turn"})[-1] == "no: the plan does not turn"


def test_the_page_says_for_the_same_reason_as_the_terminal_why_an_effect_is_not_seen(diagnosis):
    """A wrong gravity was a common scale factor there, and taken by the coefficients or too small here."""
    summary = summarise(diagnosis)
    reasons = {label: group.reason for group in summary.untestable for label in group.labels}
    page = sections.smallest(summary.reached, (), summary.untestable)
    for label in ("reference_gravity", "reference_deflection_east"):
        row = page[page.index(f">{label}<") :]
        assert escape(f"no: {reasons[label]}") in row[: row.index("</tr>")]
