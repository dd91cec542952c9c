"""What comes back in a set: a sentence, and what to do next."""

from __future__ import annotations

from collections.abc import Sequence

from sdimu_calibration.core.advice import Advice
from sdimu_calibration.core.advice import Kind as Do
from sdimu_calibration.core.joint.leftovers import ATTITUDE, KINDS, TEMPERATURE, TIME
from sdimu_calibration.core.joint.recurrence import Recurrence
from sdimu_calibration.core.plain_text import listing
from sdimu_calibration.core.probability import in_percent

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
        shown = " and ".join(
            f"{_WORDS[k.kind]} ({in_percent(k.probability)})" for k in found.kinds if k.kind in found.answer
        )
        if not found.apart:
            told = shown.replace(" and ", " or ")
            why = "the order of the stops in" if ATTITUDE in found.answer else "the temperature of"
            return f"{what} comes back at the same {told}: {why} these recordings does not tell which."
        belongs = " and ".join(_BELONGS[kind] for kind in found.answer)
        return f"{what} in {listing(found.sensors)} comes back at the same {shown}: it belongs to {belongs}."
    if not found.told:
        return f"Whether {what[0].lower()}{what[1:]} comes back cannot be told: the recordings share too few stops."
    if found.is_open:
        near = max((k for k in found.kinds if k.kind in found.told), key=lambda k: k.probability)
        of_all, of_near = in_percent(found.probability), in_percent(near.probability)
        thing = f"{what[0].lower()}{what[1:]}"
        return f"Whether {thing} comes back is open ({of_all}): nearest is the same {_WORDS[near.kind]} ({of_near})."
    whose = "it belongs to each run" if unexplained else "it is noise of each run"
    of_each = f": {whose}" if {ATTITUDE, TIME} <= set(found.told) else ""
    where = f"{' in the stops' if unexplained else ''} ({', '.join(found.sensors)})"
    return (
        f"{what}{where} does not come back at the same {listed(found.told, 'or')} "
        f"(that it does: {in_percent(found.probability)}){of_each}."
    )


def next_steps(found: Recurrence | None, unexplained: bool, function: bool = False) -> list[Advice]:
    """Say what to do about what comes back, the most useful first.

    Parameters
    ----------
    unexplained : bool
        The verdict on the set: else what does not come back is noise, and no mount or cable.
    function : bool
        An unknown function of the attitude explains it, whether or not the stops come back.
    """
    if function and (found is None or found.apart or not found.answer):
        return [_NEXT[ATTITUDE]]
    if found is None:
        return []
    if found.answer and not found.apart:
        return [Advice(Do.REVERSE_AND_ADD) if ATTITUDE in found.answer else _NEXT[TEMPERATURE]]
    if found.answer:
        return [_NEXT[kind] for kind in found.answer]
    if ATTITUDE not in found.told or found.is_open:
        return [Advice(Do.REVERSE_AND_ADD)]
    return [Advice(Do.LOOK_AT_MOUNT)] if unexplained else []


def listed(kinds: Sequence[str], between: str) -> str:
    """Name kinds in their order, the last two with a word between them."""
    return listing([_WORDS[kind] for kind in KINDS if kind in kinds], between)
