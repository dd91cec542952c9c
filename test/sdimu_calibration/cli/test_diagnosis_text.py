"""The steps of a search in the terminal: what stays is seen at once, what was taken out again is one line a reason."""

from __future__ import annotations

import numpy as np

from sdimu_calibration.cli.diagnosis_text import step_lines
from sdimu_calibration.core.diagnosis.search import Step
from sdimu_calibration.core.evidence.held_out import HeldOut

NOISE = "noise with a memory explains the same"


def step(label, **more):
    told = HeldOut(np.arange(3), np.zeros(3), 1.0)
    moved = (("gyro_bias_x", 4.2), ("gyro_bias_y", 0.3))
    return Step(
        label,
        label,
        "1",
        "ppm",
        9.0,
        4.0,
        1.0,
        0.1,
        50.0,
        40.0,
        told,
        told,
        30.0,
        10.0,
        (),
        **{"accepted": True, "reason": "", "moved": moved, **more},
    )


def test_what_was_taken_out_stands_behind_what_stays_and_keeps_its_number():
    steps = [step("a", taken_out=NOISE), step("b"), step("c", taken_out="too small"), step("d", taken_out=NOISE)]
    added, wrong, noise, small = step_lines(steps)
    assert added.startswith("step 2: b (z +9.0, threshold 4.0, log Bayes factor 40;")
    assert added.endswith(" added")
    assert wrong == "  without it these were wrong: gyro_bias_x +4.2 sigma"
    assert noise == f"added, then taken out: {NOISE}: a (step 1, z +9.0), d (step 4, z +9.0)"
    assert small == "added, then taken out: too small: c (step 3, z +9.0)"


def test_a_refused_step_says_why_and_moved_nothing():
    (only,) = step_lines([step("a", accepted=False, reason="held-out error rises")])
    assert only.endswith(" refused: held-out error rises")


def test_no_steps_are_no_lines():
    assert step_lines([]) == []
