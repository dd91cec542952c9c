"""Nodes as programs: each loads its module, and ends at once when it is told to meanwhile."""

from __future__ import annotations

from sdimu_calibration.loading import run_node_program


def rate_table_node() -> None:
    """Run the node of that name."""
    run_node_program("rate_table_sim.nodes.rate_table_node")
