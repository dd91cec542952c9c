"""Nodes as programs: each loads its module, and ends at once when it is told to meanwhile."""

from __future__ import annotations

from functools import partial

from sdimu_calibration.loading import run_node_program

adaptive = partial(run_node_program, "sdimu_calibration.nodes.adaptive_node")
calibration_node = partial(run_node_program, "sdimu_calibration.nodes.calibration_node")
compensate_node = partial(run_node_program, "sdimu_calibration.nodes.compensate_node")
recorder_node = partial(run_node_program, "sdimu_calibration.nodes.recorder_node")
replay_node = partial(run_node_program, "sdimu_calibration.nodes.replay_node")
table_goals = partial(run_node_program, "sdimu_calibration.nodes.table_goals_node")
