"""The steps of a search in the terminal: what each adds, and what was wrong without it."""

from __future__ import annotations

import numpy as np

from sdimu_calibration.cli.diagnosis_text import step_lines
from sdimu_calibration.core.diagnosis.step import Step
from sdimu_calibration.core.evidence.held_out import HeldOut


def step(label, moved):
    told = HeldOut(np.arange(3), np.zeros(3), 1.0)
    return Step(label, label, "1", "ppm", 9.0, 4.0, 1.0, 0.1, 50.0, 40.0, told, told, 30.0, 10.0, (), moved)


def test_each_step_says_what_it_adds_and_what_was_wrong_without_it():
    first, wrong, second = step_lines([step("a", (("gyro_bias_x", 4.2), ("gyro_bias_y", 0.3))), step("b", ())])
    assert first.startswith("step 1: a (z +9.0, threshold 4.0, log Bayes factor 40; log score of stops left out +30")
    assert wrong == "  without it these were wrong: gyro_bias_x +4.2 sigma"
    assert second.startswith("step 2: b ")


def test_no_steps_are_no_lines():
    assert step_lines([]) == []
