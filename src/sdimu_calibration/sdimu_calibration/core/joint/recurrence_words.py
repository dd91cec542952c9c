"""What comes back in a set: a sentence, and what to do next."""

from __future__ import annotations

from collections.abc import Sequence

from sdimu_calibration.core.advice import Advice
from sdimu_calibration.core.advice import Kind as Do
from sdimu_calibration.core.joint.leftovers import ATTITUDE, KINDS, TEMPERATURE, TIME
from sdimu_calibration.core.joint.recurrence import Kind, Recurrence

_WORDS = {ATTITUDE: "attitude", TIME: "time after the start", TEMPERATURE: "temperature"}
_BELONGS = {ATTITUDE: "the sensor", TIME: "the warm-up", TEMPERATURE: "the temperature"}
_NEXT = {ATTITUDE: Advice(Do.TRY_FORCE_EQUATION), TIME: Advice(Do.BEGIN_LATER), TEMPERATURE: Advice(Do.SOAK_MORE)}


def answer_in_words(found: Recurrence, unexplained: bool) -> str:
    """Say in one sentence what leftovers come back with.

    Parameters
    ----------
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
        # A kind that comes along with another one, as the order of the stops is one, has no figures that say so.
        shown = [by_kind[kind] for kind in found.answer if by_kind[kind].score > found.limit]
        seen = "; ".join(_figures(kind, found.limit) for kind in shown)
        if not found.apart:
            return (
                f"{what} comes back at the same {listed(found.answer, 'or')} ({seen}): the order of the stops in "
                "these recordings does not tell which."
            )
        return (
            f"{what} comes back at the same {listed(found.answer, 'and')} ({seen}): it belongs to "
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
    return f"{what}{where} does not come back at the same {listed(found.told, 'or')}{of_each}."


def next_steps(found: Recurrence | None, function: bool = False) -> list[Advice]:
    """Say what to do about what comes back, the most useful first.

    Parameters
    ----------
    function : bool
        An unknown function of the attitude explains it, whether or not the stops come back.
    """
    if function and (found is None or found.apart or not found.answer):
        return [_NEXT[ATTITUDE]]
    if found is None:
        return []
    if found.answer:
        return [_NEXT[kind] for kind in found.answer] if found.apart else [Advice(Do.REVERSE_AND_ADD)]
    if ATTITUDE not in found.told or found.doubtful:
        return [Advice(Do.REVERSE_AND_ADD)]
    return [Advice(Do.LOOK_AT_MOUNT)]


def _figures(one: Kind, limit: float) -> str:
    """Name the sensors of a kind, how well recordings agree, and what chance does."""
    where = f"{', '.join(one.sensors)}: " if one.sensors else ""
    return f"{where}correlation {one.correlation:.2f}, {one.score:.1f} sigma where chance ends at {limit:.1f}"


def listed(kinds: Sequence[str], between: str) -> str:
    """Name kinds in their order, the last two with a word between them."""
    words = [_WORDS[kind] for kind in KINDS if kind in kinds]
    return f" {between} ".join([", ".join(words[:-1]), words[-1]] if len(words) > 1 else words)
