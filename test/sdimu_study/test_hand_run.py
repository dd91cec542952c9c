"""Runs by hand with nudges and bias instability: scored by name, nothing called a step that only wanders."""

from __future__ import annotations

import numpy as np
import pytest

from sdimu_calibration.core.data.static_detection import detect_static
from sdimu_calibration.core.diagnosis.diagnose import climb
from sdimu_calibration.core.estimation.prepared_test import PreparedTest
from sdimu_calibration.core.estimation.solve import solve
from sdimu_calibration.core.specification import Site
from sdimu_calibration.storage.files.config import load_imu, load_model
from sdimu_sim.core.by_hand import ByHand, by_hand_recording
from sdimu_study.hand import CLEAN, HIDDEN, STUDY

# Seeds of their own: those of the study are 69001 and up.
SEEDS = (71, 72, 73)
SITE = Site(latitude_rad=float(np.radians(36.4)))


@pytest.mark.parametrize("seed", [SEEDS[0], pytest.param(SEEDS[1], marks=pytest.mark.slow)])
def test_clean_runs_are_clean_and_their_attitudes_are_counted_once(seed):
    row = STUDY.of((CLEAN,))(seed)
    assert row["verdict"] == "consistent", row["sentence"]
    assert row["rests"] == row["attitudes"]
    assert np.sqrt(row["z2"] / row["count"]) < 2.0


def test_a_hidden_effect_is_named():
    assert STUDY.of((HIDDEN,))(SEEDS[0])["in_class"]


@pytest.mark.slow
def test_a_hidden_effect_is_named_in_most_runs():
    rows = [STUDY.of((HIDDEN,))(seed) for seed in SEEDS]
    assert sum(row["in_class"] for row in rows) >= 2


def test_nudges_cut_rests_and_do_not_change_what_is_at_rest():
    imu = load_imu("mems_by_hand")
    quiet, nudged = (ByHand(20, imu, SITE, seed=4, nudges=share) for share in (0.0, 1.0))
    still, shaken = (by_hand_recording(run)[0] for run in (quiet, nudged))
    assert shaken.t[-1] > still.t[-1] + 7.0
    assert len(detect_static(shaken)) == len(detect_static(still)) == 20


def test_a_step_that_wandering_does_not_explain_is_still_a_step():
    imu = load_imu("mems_by_hand")
    run = ByHand(
        30, imu, SITE, seed=5, effects=("gyro_bias_step_x(t0=60 s)=0.1 deg/s",), noise=("gyro_noise_flicker=20 deg/h",)
    )
    found = climb(solve(PreparedTest(by_hand_recording(run)[0], imu), load_model("hand"), "handheld"))
    assert any("gyro_bias_step_x" in c.label for c in found.chosen), found.sentence
