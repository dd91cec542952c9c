"""A plan written as YAML, as `load_plan` reads it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

from sdimu_calibration.core.plan import Plan
from sdimu_calibration.storage.files.whole_file import write_whole


def write_plan(path: Path, plan: Plan, remarks: Sequence[str] = ()) -> None:
    """Write a plan; its folder is made too; `remarks` are comments for the head of the file."""
    deg = {turn: (_number(math.degrees(turn.angle_rad)), _number(math.degrees(turn.rate_rad_s))) for turn in plan.turns}
    lines = [f"# {remark}" for remark in remarks]
    lines += ["format: sdimu-plan/1", f"name: {path.stem}", f"dwell: {_number(plan.dwell_s[0])} s"]
    rate = deg[plan.turns[0]][1] if plan.turns else "1"
    lines += [f"rate: {rate} deg/s", f"acceleration: {_number(math.degrees(plan.acceleration_rad_s2))} deg/s^2"]
    lines.append("turns:" if plan.turns else "turns: []")
    for turn, dwell in zip(plan.turns, plan.dwell_s[1:], strict=True):
        angle, speed = deg[turn]
        lines.append(f"  - {{axis: {turn.axis}, angle: {angle} deg, rate: {speed} deg/s, dwell: {_number(dwell)} s}}")
    write_whole(path, "\n".join(lines) + "\n")


def _number(value: float) -> str:
    # Ten digits: degrees that went through radians come back as they were written.
    return f"{value:.10g}"
