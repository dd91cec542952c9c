"""The recording that tells apart what the data of a unit leave open, found by covariance: of one recording or of many.

Of two effects that look the same the entropy falls with the significance by which they differ, so the turn that makes
most of that a minute lowers it most.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from sdimu_calibration.core.advice import Advice, Kind, Verb
from sdimu_calibration.core.effects import selection
from sdimu_calibration.core.estimation.solve import with_effects
from sdimu_calibration.core.evidence.known import Standing
from sdimu_calibration.core.plan import Plan
from sdimu_calibration.core.plan_search import NextTurn, Question, next_turn
from sdimu_calibration.core.recording import DataError

_REST_S = 100.0
"""Length of the rests of an advised recording (s): that of the plans, enough to level and to find north."""
_ACCELERATION_RAD_S2 = math.radians(20.0)
"""Acceleration of its turns (rad/s^2): half a second to the fastest rate of `next_turn`."""
TELLS = 3.0
"""Significance (sigma) from which effects are told apart: a turn that reaches less is no advice."""
Closing = Sequence[tuple[tuple[str, ...], NextTurn]]
"""Members of each open class, and the turn that tells most of it a minute."""


def next_recording(standing: Standing, asked: Question, values: Mapping[str, float]) -> Closing:
    """Find the shortest recording that tells the members of each open class apart, all earlier data counted.

    Parameters
    ----------
    asked : Question
        Site, IMU, and the model that was given.
    values : mapping of str to float
        Estimates of coefficients (SI), those of the first members among them.

    Returns
    -------
    sequence of (tuple of str, NextTurn)
        Of a class that holds what no plan can foresee, such as an equation, none.
    """
    stay = Plan("next", (_REST_S,), (), _ACCELERATION_RAD_S2)
    found = []
    for members in standing.open:
        try:
            have = {label for e in asked.model.effects for label in selection.resolve(e).labels}
            added = [label for label in standing.added if label not in have and label not in members]
            question = replace(asked, model=with_effects(asked.model, added), known=standing.known)
            ranked = next_turn(stay, question, members, _sizes(standing, members, values))
        except DataError:
            continue
        found.append((members, ranked[0]))
    return found


def closing_advice(closing: Closing) -> list[Advice]:
    """Advise the recording that closes each class, then a whole plan, which closes all that it can."""
    out = []
    for (label, *others), turn in closing:
        if turn.after < TELLS:
            out.append(Advice(Kind.NO_TURN_TELLS, (label, tuple(others), turn.after, TELLS)))
        else:
            out.append(Advice(Kind.RECORD_ONCE_MORE, (label, tuple(others), _REST_S, turn.text)))
    return [*out, Advice(Kind.PLAN_NEXT, (), Verb.CONTINUE)] if out else []


def _sizes(standing: Standing, members: Sequence[str], values: Mapping[str, float]) -> dict[str, float]:
    """Size (SI) of each member of a class if it were the cause: the first as estimated, the others to match it."""
    names = [selection.resolve(label).parameters[0].name for label in members]
    J = standing.known.of(names, np.ones(len(names)))
    own = abs(values.get(names[0], 0.0))
    if not own > 0.0:
        return {}
    return {name: own * float(abs(J[0, k]) / J[k, k]) for k, name in enumerate(names) if J[k, k] > 0.0}
