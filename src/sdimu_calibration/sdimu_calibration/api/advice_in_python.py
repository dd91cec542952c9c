"""What an advice means in Python: calls instead of the commands of a shell."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace

from sdimu_calibration.core.advice import Advice, Verb
from sdimu_calibration.storage.files.advice_words import PLAN_IS, SHELL, Speech, general_command

_TOGETHER = 'sdimu.diagnose(sdimu.calibrate(sdimu.open_set(["FIRST", "SECOND"])))'
_ALONE = 'sdimu.diagnose(sdimu.calibrate(sdimu.open("BAG")))'


_Spans = Sequence[tuple[float, float]]


def in_python(has_plan: bool, excluded: _Spans = ()) -> Speech:
    """Say how advice about one recording reads in Python.

    Parameters
    ----------
    has_plan : bool
        Whether the motion showed the plan.
    excluded : sequence of (float, float)
        Spans of time (s) that the fit leaves out already: an advice to leave out another one keeps them.
    """
    return Speech(
        command=lambda advice: _call(advice, has_plan, excluded),
        together=_TOGETHER,
        alone=_ALONE,
        attempt='sdimu.diagnose(fit, attempt=["FILE"])',
        site="site=...",
        backwards=_backwards(has_plan),
    )


def _backwards(has_plan: bool) -> str:
    return "found.plan.backwards()" if has_plan else f"in a shell, {SHELL.backwards}"


def _call(advice: Advice, has_plan: bool, excluded: _Spans) -> str:
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
            # The test as it was opened: site, IMU and units stay as they were stated.
            return f"sdimu.diagnose(sdimu.calibrate(fit.test.without_times({_spans(advice, excluded)})))"
        case Verb.CUT:
            return f"in a shell, {general_command(advice)}"
        case Verb.REVERSE_PLAN:
            return _backwards(has_plan)
    named = ", ".join(map(_text, advice.about))
    return f"found.turns({named})" if has_plan else f'found.turns({named}, plan="PLAN") ({PLAN_IS})'


def _spans(advice: Advice, excluded: _Spans) -> tuple[tuple[float, float], ...]:
    """List the times that are left out already, and that which an advice names, once each (s)."""
    begin, _, end = advice.about[0].rpartition("-")
    spans = [(float(one), float(other)) for one, other in (*excluded, (float(begin), float(end)))]
    return tuple(dict.fromkeys(spans))


def _call_of_set(advice: Advice) -> str:
    """Write the calls that an advice about a set means: a set has no turns and no times of its own."""
    match advice.verb:
        case Verb.ADD:
            return f"sdimu.calibrate(set, add={_listed(advice.about)})"
        case Verb.RANK_TURNS:
            return f"in a shell, {general_command(advice)}"
        case Verb.LEAVE_OUT:
            times = list(_spans(advice, ()))
            return f'sdimu.diagnose(sdimu.calibrate(sdimu.open("BAG", exclude_times={times})))'
    return _call(advice, has_plan=False, excluded=())


def _listed(keys: Sequence[str]) -> str:
    return f"[{', '.join(map(_text, keys))}]"


def _text(key: str) -> str:
    """Write a text as Python does, with the quotes of the examples."""
    return json.dumps(key, ensure_ascii=False)


IN_PYTHON_OF_A_SET = replace(in_python(has_plan=False), command=_call_of_set)
"""How advice about several recordings reads in Python."""
