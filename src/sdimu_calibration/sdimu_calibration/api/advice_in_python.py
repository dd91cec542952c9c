"""What an advice means in Python: calls instead of the commands of a shell."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace

from sdimu_calibration.core.advice import Advice, Verb
from sdimu_calibration.storage.files.advice_words import PLAN_IS, SHELL, Speech, general_command

_TOGETHER = 'sdimu.diagnose(sdimu.calibrate(sdimu.open_set(["FIRST", "SECOND"])))'
_ALONE = 'sdimu.diagnose(sdimu.calibrate(sdimu.open("BAG")))'


def in_python(has_plan: bool) -> Speech:
    """Say how advice about one recording reads in Python; `has_plan`: whether the motion showed the plan."""
    return Speech(
        command=lambda advice: _call(advice, has_plan),
        together=_TOGETHER,
        alone=_ALONE,
        attempt='sdimu.diagnose(fit, attempt=["FILE"])',
        site="site=...",
        backwards="found.plan.backwards()" if has_plan else f"in a shell, {SHELL.backwards}",
    )


def _call(advice: Advice, has_plan: bool) -> str:
    """Write the calls that an advice about one recording means; empty where it means none."""
    match advice.verb:
        case None:
            return ""
        case Verb.ADD:
            return "fit" + "".join(f".add({_text(key)})" for key in advice.about)
        case Verb.DIAGNOSE:
            return "sdimu.diagnose(fit)"
        case Verb.CONTINUE:
            return "sdimu.plan(after=found.known)"
        case Verb.LEAVE_OUT:
            begin, _, end = advice.about[0].rpartition("-")
            return f"sdimu.open(..., exclude_times=[({begin}, {end})])"
        case Verb.CUT:
            return f"in a shell, {general_command(advice)}"
        case Verb.REVERSE_PLAN:
            return in_python(has_plan).backwards
    named = ", ".join(map(_text, advice.about))
    return f"found.turns({named})" if has_plan else f'found.turns({named}, plan="PLAN") ({PLAN_IS})'


def _call_of_set(advice: Advice) -> str:
    if advice.verb == Verb.ADD:
        return f"sdimu.calibrate(set, add={_listed(advice.about)})"
    return _call(advice, has_plan=False)


def _listed(keys: Sequence[str]) -> str:
    return f"[{', '.join(map(_text, keys))}]"


def _text(key: str) -> str:
    """Write a text as Python does, with the quotes of the examples."""
    return json.dumps(key, ensure_ascii=False)


IN_PYTHON_OF_A_SET = replace(in_python(has_plan=False), command=_call_of_set)
"""How advice about several recordings reads in Python."""
