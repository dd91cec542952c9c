"""Nodes as programs: each loads its module, and ends at once when it is told to meanwhile."""

from __future__ import annotations

from functools import partial

from sdimu_calibration.loading import run_node_program

sdimu_node = partial(run_node_program, "sdimu_sim.nodes.sdimu_node")
