"""What comes back in a set, in words: a sentence, and what to do next."""

from __future__ import annotations

from collections.abc import Sequence

from sdimu_calibration.core.joint.leftovers import ATTITUDE, KINDS, TEMPERATURE, TIME
from sdimu_calibration.core.joint.recurrence import Kind, Recurrence

_WORDS = {ATTITUDE: "attitude", TIME: "time after the start", TEMPERATURE: "temperature"}
_BELONGS = {ATTITUDE: "the sensor", TIME: "the warm-up", TEMPERATURE: "the temperature"}
_ORDER = "record the plan in another order (sdimu plan --plan YOURS --backwards), and diagnose it with these"
_NEXT = {
    ATTITUDE: "what comes back at the same attitude is an error of the sensor that the catalogue lacks: try an "
    "equation of the specific force (sdimu diagnose BAG --try FILE)",
    TIME: "what comes back at the same time is over when the unit is warm: begin the plan later, or let the first "
    "stop be longer",
    TEMPERATURE: "what comes back at the same temperature is told by soaks: record at more temperatures that stand "
    "still",
}
_OF_EACH = "what does not come back is of each run: look at mount, cables and floor, and take it for scatter until then"


def answer_in_words(found: Recurrence, unexplained: bool) -> str:
    """Say in one sentence what leftovers come back with.

    Parameters
    ----------
    found : Recurrence
    unexplained : bool
        The verdict on the set.

    Returns
    -------
    str
        A sentence.
    """
    what = "What stays unexplained" if unexplained else "What the model leaves in the stops"
    if found.answer:
        by_kind = {k.kind: k for k in found.kinds}
        seen = "; ".join(_figures(by_kind[kind], found.limit) for kind in found.answer)
        if not found.apart:
            return (
                f"{what} comes back at the same {_listed(found.answer, 'or')} ({seen}): the order of the stops in "
                "these recordings does not tell which."
            )
        return (
            f"{what} comes back at the same {_listed(found.answer, 'and')} ({seen}): it belongs to "
            f"{' and '.join(_BELONGS[kind] for kind in found.answer)}."
        )
    if found.doubtful:
        near = next(k for k in found.kinds if k.kind == found.doubtful[0])
        return (
            f"Whether {what[0].lower()}{what[1:]} comes back is open: nearest is the same {_WORDS[near.kind]} "
            f"({_figures(near, found.limit)})."
        )
    if not found.told:
        return f"Whether {what[0].lower()}{what[1:]} comes back cannot be told: the recordings share too few stops."
    of_each = ": it belongs to each run" if {ATTITUDE, TIME} <= set(found.told) else ""
    where = f"{' in the stops' if unexplained else ''} ({', '.join(found.sensors)})"
    return f"{what}{where} does not come back at the same {_listed(found.told, 'or')}{of_each}."


def next_steps(found: Recurrence | None) -> list[str]:
    """Say what to do about what comes back, the most useful first."""
    if found is None:
        return []
    if found.answer:
        return [_NEXT[kind] for kind in found.answer] if found.apart else [_ORDER]
    if ATTITUDE not in found.told or found.doubtful:
        return [_ORDER]
    return [_OF_EACH]


def _figures(one: Kind, limit: float) -> str:
    """Name the sensors of a kind, how well recordings agree, and what chance does."""
    where = f"{', '.join(one.sensors)}: " if one.sensors else ""
    return f"{where}correlation {one.correlation:.2f}, {one.score:.1f} sigma where chance ends at {limit:.1f}"


def _listed(kinds: Sequence[str], between: str) -> str:
    words = [_WORDS[kind] for kind in KINDS if kind in kinds]
    return f" {between} ".join([", ".join(words[:-1]), words[-1]] if len(words) > 1 else words)
