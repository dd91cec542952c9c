"""Axis profiles and gimbal geometry: pure functions on numpy arrays, no ROS and no files."""

from rate_table_sim.core.motion import TableMotion, phase_changes, reported_samples, table_motion
from rate_table_sim.core.specification import Imperfections, TableSpecification

__all__ = ["Imperfections", "TableMotion", "TableSpecification", "phase_changes", "reported_samples", "table_motion"]
