"""Advice as whole commands: with the recording, the options that were given, and everything spelled out."""

from __future__ import annotations

import re
import shlex
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sdimu_calibration.core.diagnosis.plan_seen import PlanSeen
    from sdimu_calibration.core.plan import Plan

PLAN = "plan.yaml"
"""File beside a diagnosis: the plan as the motion showed it."""
DIAGNOSE = "run: sdimu diagnose"
"""Words of a note that sends to a diagnosis."""
_ACCELERATION = 1.0
"""Angular acceleration (rad/s^2) of a plan that was seen: the motion does not tell the limit, and no sum needs it."""
_COMMAND = re.compile(r"^(.*?):? ((?:sdimu [a-z]+ |--add ).*?)\.?$")


@dataclass(frozen=True)
class Asked:
    """What a verb was asked for, so far as the next one has to repeat it.

    Attributes
    ----------
    bags : sequence of Path
    site, imu, model : str or None
    add : sequence of str
    folder : Path
        Of the results.
    """

    bags: Sequence[Path]
    site: str | None
    imu: str | None
    model: str | None
    add: Sequence[str]
    folder: Path


def pasted(
    verb: str, bags: Sequence[Path], site: str | None, imu: str | None, model: str | None, add: Sequence[str] | None
) -> str:
    """Write a command that repeats a recording and its options."""
    options = _stated(("--site", site), ("--imu", imu), ("--model", model))
    return shlex.join(
        ["sdimu", verb, *map(str, bags), *options, *(text for one in add or () for text in ("--add", one))]
    )  # fmt: skip


def _stated(*options: tuple[str, str | None]) -> list[str]:
    """Options that have a value, as words of a command."""
    return [text for name, value in options if value for text in (name, value)]


def spelled(advice: str, asked: Asked) -> tuple[str, str]:
    """Part an advice into words and the whole command that it means; no command where it names none.

    ``Keep X in the model: --add 'X'.`` becomes a calibration of the recording, ``sdimu plan --plan YOURS`` names
    the plan that was seen and the same site and IMU.
    """
    found = _COMMAND.match(advice)
    if found is None:
        return advice, ""
    words, rest = found.groups()
    if rest.startswith("--add"):
        rest = f"{pasted('calibrate', asked.bags, asked.site, asked.imu, asked.model, asked.add)} {rest}"
    elif rest.startswith("sdimu plan"):
        where = _stated(("--site", asked.site), ("--imu", asked.imu))
        plan = shlex.join(["--plan", str(asked.folder / PLAN), *where])
        rest = rest.replace("sdimu plan --plan YOURS", "sdimu plan").replace("sdimu plan", f"sdimu plan {plan}", 1)
    elif rest.startswith("sdimu diagnose BAG"):
        rest = rest.replace("BAG", shlex.quote(str(asked.bags[0])), 1)
    return f"{words}:", rest


def as_plan(seen: PlanSeen | None) -> Plan | None:
    """Write the plan that was seen as a plan to begin with; None where a turn was about several axes, or none was.

    Angles are rounded to whole degrees and rates to tenths: the motion tells them to the mount and the scale factors.
    """
    import math

    from sdimu_calibration.core.plan import Plan, Turn

    if seen is None or not seen.turns or any(turn.axis is None for turn in seen.turns):
        return None
    dwell = max(1.0, round(60.0 * seen.dwell_minutes))
    turns = []
    for turn in seen.turns:
        angle, rate = round(math.degrees(turn.angle)), round(abs(math.degrees(turn.rate)), 1)
        if not angle or not rate or turn.axis is None:
            return None
        turns.append(Turn("XYZ"[turn.axis], math.radians(angle), math.radians(rate)))
    return Plan("seen", (dwell,) * (len(turns) + 1), tuple(turns), _ACCELERATION)
