"""Nodes as programs: each loads its module, and ends at once when it is told to meanwhile."""

from __future__ import annotations

from sdimu_calibration.loading import run_node_program


def adaptive() -> None:
    """Run the node of that name."""
    run_node_program("sdimu_calibration.nodes.adaptive_node")


def calibration_node() -> None:
    """Run the node of that name."""
    run_node_program("sdimu_calibration.nodes.calibration_node")


def compensate_node() -> None:
    """Run the node of that name."""
    run_node_program("sdimu_calibration.nodes.compensate_node")


def recorder_node() -> None:
    """Run the node of that name."""
    run_node_program("sdimu_calibration.nodes.recorder_node")


def replay_node() -> None:
    """Run the node of that name."""
    run_node_program("sdimu_calibration.nodes.replay_node")


def table_goals() -> None:
    """Run the node of that name."""
    run_node_program("sdimu_calibration.nodes.table_goals_node")
