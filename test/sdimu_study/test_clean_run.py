"""The study of clean tests: plans that no file holds, and a page that counts apart what is said of nothing."""

from __future__ import annotations

import numpy as np
import pytest

from rate_table_sim.core import table_motion
from sdimu_calibration.core.recording import DataError
from sdimu_study.clean import BY_HAND, STUDY, page, plans_of
from sdimu_study.cli.conduct import imu_files
from sdimu_study.plans import PLANS, study_plan, study_table


@pytest.mark.parametrize("name", PLANS)
def test_the_table_of_a_plan_can_make_it(name):
    plan = study_plan(name, 3)
    assert plan.name == name
    motion = table_motion(plan, study_table(name), 0)
    assert motion.t[-1] == pytest.approx(plan.duration_s, abs=1.0)


def test_plans_last_as_long_as_their_names_say():
    assert study_plan("kim18_10_min", 1).duration_s == pytest.approx(600.0, abs=30.0)
    assert study_plan("kim18_3_h", 1).duration_s == pytest.approx(3.0 * 3600.0, abs=60.0)


def test_six_positions_point_every_axis_up_and_down():
    motion = table_motion(study_plan("six_positions", 1), study_table("six_positions"), 0)
    stands = np.linalg.norm(motion.omega_nt_t, axis=1) == 0.0
    down = _down(motion.q_nt[stands])
    for axis in range(3):
        assert down[:, axis].max() == pytest.approx(1.0, abs=1e-6)
        assert down[:, axis].min() == pytest.approx(-1.0, abs=1e-6)


def _down(q):
    """Down seen in the platform, shape (n, 3), of quaternions (w, x, y, z)."""
    w, x, y, z = q.T
    return np.column_stack([2 * (x * z - w * y), 2 * (y * z + w * x), w * w - x * x - y * y + z * z])


def test_random_attitudes_follow_the_seed_and_nothing_else_does():
    assert study_plan("random_attitudes", 1) == study_plan("random_attitudes", 1)
    assert study_plan("random_attitudes", 1) != study_plan("random_attitudes", 2)
    assert study_plan("six_positions", 1) == study_plan("six_positions", 2)


def test_runs_by_hand_have_no_plan():
    assert plans_of("mems_by_hand") == (BY_HAND,)
    assert plans_of("dtg") == PLANS


@pytest.mark.parametrize("seed", [55_003, *(pytest.param(more, marks=pytest.mark.slow) for more in (55_004, 55_016))])
def test_a_clean_test_in_ten_minutes_is_consistent(seed):
    """This grade and plan named an effect in seven of seventeen tests while the force was taken as measured."""
    assert STUDY.of(("fog_tactical", "kim18_10_min"))(seed)["verdict"] == "consistent"


def test_the_page_counts_effects_noise_and_refusals_apart():
    good = {"named": [], "noise": [], "verdict": "consistent", "z2": 27.0, "count": 27, "largest_z": 2.0}
    rows = [
        good,
        good | {"named": [["gyro_delay_x"]]},
        good | {"noise": ["flicker"], "verdict": "unexplained"},
        good | {"verdict": "data fault", "largest_z": 4.0},
        {"error": "DataError: why", "seed": 7},
    ]
    lines = page({("dtg", "kim18"): rows}, 1).splitlines()
    one, total = lines[-6:-4]
    assert one == "| dtg | kim18 | 5 | 1 | 1 | 1 | 1 | 1.00 | 4.0 |"
    assert total.startswith("| **all** |")
    assert lines[-1] == "- dtg on kim18, seed 7: DataError: why"


@pytest.mark.parametrize("name", ["nosuch", "/tmp/dtg.yaml", "../dtg"])
def test_an_imu_file_that_a_study_does_not_know_is_refused_before_any_work(name):
    with pytest.raises(DataError, match=f"--imu {name}: this study needs a file in .*/imu: one of dtg, fog_tactical"):
        imu_files(["dtg", name])


def test_the_imu_files_of_a_study_are_each_once_and_all_without_a_wish():
    assert imu_files(["dtg", "fog_tactical", "dtg"]) == ["dtg", "fog_tactical"]
    assert "mems_by_hand" in imu_files(None)
    assert "mems_by_hand" not in imu_files(None, without="mems_by_hand")
