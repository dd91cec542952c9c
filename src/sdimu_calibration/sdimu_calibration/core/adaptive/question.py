"""What a running test asks at the end of each stop: which move is next, or is it the end.

A function that a process of its own answers (`nodes.diagnosis_worker`), because a fit of minutes of data does not go
through a pipe, and what comes of it here does.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np

from sdimu_calibration.core.adaptive.choice import Choice, End, choose
from sdimu_calibration.core.adaptive.goals import Goals
from sdimu_calibration.core.adaptive.knowledge import Knowledge, fitted, knowledge
from sdimu_calibration.core.adaptive.menu import Menu
from sdimu_calibration.core.diagnosis.diagnose import climb
from sdimu_calibration.core.diagnosis.live_diagnosis import LiveDiagnosis
from sdimu_calibration.core.estimation.fit import Fit
from sdimu_calibration.core.table import RateTable, Step, is_possible
from sdimu_calibration.core.verdict import Verdict


@dataclass(frozen=True)
class Situation:
    """Where a running test stands, and what it may do next."""

    goals: Goals
    """When the test may end."""
    menu: Menu
    """Moves that it may choose from."""
    table: RateTable
    angles: tuple[float, ...]
    """Of the joints of the table (rad)."""
    elapsed_s: float
    """Since the test began (s): what was recorded before does not count."""


@dataclass(frozen=True)
class Decision:
    """What to do next, and what it was decided by."""

    step: Step | None
    """None ends the test."""
    text: str
    """Move and reason, or the reason of the end."""
    reason: str
    """The reason alone."""
    reached: bool
    """The test ends with all limits held and no class open."""
    until_s: float
    """Since the test began (s)."""
    worst: float
    """Largest sigma over its limit (1)."""
    named: tuple[str, ...]
    alike: tuple[str, ...]
    """`named`, `alike`: effects that were found, and what the first open class holds besides."""
    decided: tuple[str, ...] = ()
    """Of `named` those of which it is sure that they are missing: the result of the test has them."""


def next_move(fit: Fit, diagnosis: LiveDiagnosis, about: Situation) -> Decision:
    """Choose the next move of a test.

    The search for effects is made when something stands out, and before the test ends.

    `fit`: of what was recorded so far.
    """
    left = about.goals.minutes - about.elapsed_s / 60.0
    searched = diagnosis.verdict != Verdict.CONSISTENT
    known = knowledge(climb(fit), about.goals) if searched else fitted(fit, about.goals)
    chosen = _choose(known, about, left)
    if isinstance(chosen, End) and not searched:
        known = knowledge(climb(fit), about.goals)
        chosen = _choose(known, about, left)
    alike = () if known.open is None else known.open.alike
    facts = (about.elapsed_s, float(known.ratio.max()), known.named, alike, known.decided)
    if isinstance(chosen, End):
        return Decision(None, f"the test ends: {chosen.reason}", chosen.reason, chosen.reached, *facts)
    return Decision(chosen.step, chosen.text, chosen.reason, False, *facts)


def _choose(known: Knowledge, about: Situation, minutes_left: float) -> Choice | End:
    possible = partial(is_possible, about.table, np.array(about.angles))
    return choose(known, about.goals, about.menu, minutes_left, possible)
