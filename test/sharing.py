"""How tests are shared out to the workers of a parallel run, so that both end at the same time.

A file's tests stay on one worker, which makes its fixtures once. `pytest-xdist` hands out the files with most tests
first, so a file of few long ones comes last, and one worker ends minutes after the other. Here the longest come first,
a file whose tests share no fixture is handed out test by test, and files that share a long one stay together.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import pytest

APART = (
    "test/book/test_blocks.py",
    "test/recovery/test_faults.py",
    "test/recovery/test_grades.py",
    "test/mutation/test_mutations.py",
    "test/sdimu_calibration/core/joint/test_static_sets.py",
)
"""Files of long tests that share nothing: their tests may go to any worker."""

_DIAGNOSES = "test/sdimu_calibration/core/diagnosis/test_diagnose.py"
TOGETHER = {
    "test/ros/test_layouts.py": "test/ros/test_whole_run.py",
    "test/ros/test_transforms.py": "test/ros/test_whole_run.py",
    "test/sdimu_calibration/core/diagnosis/test_assumed.py": _DIAGNOSES,
    "test/sdimu_calibration/core/diagnosis/test_averaged.py": _DIAGNOSES,
    "test/sdimu_calibration/core/diagnosis/test_coefficient_shifts.py": _DIAGNOSES,
    "test/sdimu_calibration/core/diagnosis/test_grades.py": _DIAGNOSES,
    "test/sdimu_calibration/core/diagnosis/test_traps.py": _DIAGNOSES,
    "test/sdimu_calibration/core/posterior/test_coefficients.py": _DIAGNOSES,
    "test/sdimu_calibration/core/posterior/test_excess.py": _DIAGNOSES,
    "test/sdimu_calibration/core/posterior/test_open_noise.py": _DIAGNOSES,
    "test/sdimu_calibration/core/posterior/test_search_again.py": _DIAGNOSES,
    "test/sdimu_calibration/core/posterior/test_unknown.py": _DIAGNOSES,
    "test/sdimu_study/test_noise_run.py": "test/sdimu_study/test_believed.py",
    "test/sdimu_study/test_reliability.py": "test/sdimu_study/test_ahead.py",
}
"""Files that go to the worker of another one, with which they share a run over DDS, or fits and diagnoses."""

DOMAINS_A_RUN = 4
"""Number of ROS domains that a parallel run of tests takes, from its first one; with more workers some share."""
LONGEST = (
    "test/browser/test_workbench_in_a_browser.py",
    "test/browser/test_workbench_page_in_a_browser.py",
    "test/book/test_blocks.py",
    "test/sdimu_calibration/core/diagnosis/test_diagnose.py",
    "test/sdimu_calibration/core/joint/test_set_search.py",
    "test/sdimu_calibration/core/joint/test_function_fit.py",
    "test/sdimu_calibration/report/workbench/test_workbench.py",
    "test/browser/test_report_in_a_browser.py",
    "test/browser/test_live_page_in_a_browser.py",
    "test/browser/test_fleet_in_a_browser.py",
    "test/sdimu_calibration/core/diagnosis/test_effects_in_noise.py",
    "test/sdimu_calibration/core/batch/test_batch.py",
    "test/sdimu_calibration/core/estimation/test_every_estimator.py",
    "test/sdimu_calibration/cli/test_terminal.py",
    "test/sdimu_calibration/core/diagnosis/test_strong_flicker.py",
    "test/sdimu_calibration/core/diagnosis/test_unknown_attitude.py",
    "test/sdimu_calibration/core/posterior/test_near.py",
    "test/sdimu_calibration/core/joint/test_shared_scatter.py",
    "test/sdimu_calibration/storage/test_matlab_objects.py",
    "test/sdimu_calibration/core/test_live_end.py",
    "test/sdimu_calibration/core/posterior/test_noise_models.py",
    "test/recovery/test_faults.py",
    "test/recovery/test_grades.py",
    "test/mutation/test_mutations.py",
    "test/ros/test_ros_machine.py",
    "test/ros/test_robustness.py",
    "test/ros/test_table_goals.py",
    "test/ros/test_watch_a_run.py",
    "test/ros/test_whole_run.py",
    "test/ros/test_layouts.py",
    "test/ros/test_foreign_messages.py",
    "test/ros/test_live_page.py",
    "test/ros/test_adaptive.py",
    "test/ros/test_add_live.py",
    "test/ros/test_stay.py",
    "test/ros/test_live_diagnosis.py",
    "test/ros/test_launch_files.py",
    "test/ros/test_checkpoint.py",
    "test/sdimu_calibration/core/joint/test_static_sets.py",
    "test/sdimu_calibration/core/joint/test_changed.py",
    "test/sdimu_calibration/core/estimation/test_free_azimuth.py",
    "test/sdimu_calibration/core/posterior/test_likely_noise.py",
    "test/sdimu_study/test_hand_run.py",
    "test/sdimu_study/test_believed.py",
    "test/sdimu_study/test_ahead.py",
    "test/sdimu_study/test_soak_run.py",
    "test/sdimu_study/test_campaign.py",
    "test/sdimu_study/test_disturbed_run.py",
    "test/sdimu_calibration/core/joint/test_set_fit.py",
    "test/sdimu_calibration/cli/test_exit_status.py",
    "test/sdimu_calibration/core/diagnosis/test_pairs.py",
    "test/sdimu_calibration/api/test_recording_set.py",
    "test/sdimu_calibration/api/test_api.py",
    "test/sdimu_calibration/core/diagnosis/test_families.py",
    "test/recovery/test_recovery.py",
    "test/sdimu_calibration/core/diagnosis/test_strong_effects.py",
    "test/sdimu_calibration/core/filter/test_percents.py",
    "test/sdimu_calibration/core/noise/test_quantisation.py",
    "test/sdimu_calibration/cli/test_diagnose.py",
    "test/sdimu_calibration/core/posterior/test_combinations.py",
    "test/sdimu_calibration/core/diagnosis/test_averaged.py",
    "test/sdimu_calibration/core/posterior/test_open_noise.py",
    "test/sdimu_calibration/core/test_live_noise.py",
    "test/sdimu_calibration/api/test_advice_in_python.py",
    "test/sdimu_calibration/core/joint/test_set_board.py",
)
"""Files that keep a processor busy for 5 s and more, the longest first; the rest follow by their number of tests."""


def scope_of(name: str) -> str:
    """Name what stays on one worker with a test: its file, that of its fixture, or the test alone.

    Parameters
    ----------
    name : str
        Of the test, as pytest prints it.
    """
    file = name.partition("::")[0]
    return name if file in APART else TOGETHER.get(file, file)


def longest_first(items: Sequence[pytest.Item]) -> list[pytest.Item]:
    """Order tests so that the longest files come first; within a file they keep their order."""
    files = [item.nodeid.partition("::")[0] for item in items]
    rank = {file: (0, place) for place, file in enumerate(LONGEST)}
    rank |= {file: (1, -files.count(file)) for file in set(files) - set(LONGEST)}
    order = sorted(range(len(items)), key=lambda k: (*rank[files[k]], files[k]))
    return [items[k] for k in order]


def sharing(config: pytest.Config, log: Any) -> object:
    """Make the scheduler of `pytest-xdist` that hands out scopes in the order of the tests."""
    # Where tests run in one process, the plugin may be missing.
    from xdist.scheduler import LoadFileScheduling

    class Sharing(LoadFileScheduling):
        def _split_scope(self, nodeid: str) -> str:
            return scope_of(nodeid)

    config.option.loadscopereorder = False
    return Sharing(config, log)
