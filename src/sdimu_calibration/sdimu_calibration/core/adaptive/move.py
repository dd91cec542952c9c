"""What each possible move would bring: a turn and the best stop after it, also after a turn that leads there."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from sdimu_calibration.core.adaptive.goals import Goals
from sdimu_calibration.core.adaptive.knowledge import Knowledge
from sdimu_calibration.core.adaptive.menu import Menu
from sdimu_calibration.core.adaptive.so_far import Ahead, SoFar, ahead
from sdimu_calibration.core.adaptive.worth import Worth, worth
from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.plan import Turn
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.table import Step

_DECISION_S = 5.0
"""Time that a stop costs beside its length (s): fit and choice at its end; without it stops would be shortest."""
_LEADING_RAD = (math.pi / 2.0, -math.pi / 2.0)
"""Turns (rad) that lead to another move: they bring a body axis from upright to level, or back."""


@dataclass(frozen=True)
class Stand:
    """Where a test stands, and what it asks of a move; see `choice.choose`."""

    known: Knowledge
    goals: Goals
    menu: Menu
    at: SoFar
    """Where moves since the last look have brought the test."""
    minutes_left: float
    possible: Callable[..., bool]

    @cached_property
    def now(self) -> Worth:
        """What is lacking before a move."""
        return worth(self.known, self.goals, self.at.covariance[None], self.known.at.covariance)

    def step(self, turn: Turn) -> Step:
        """Make a turn a step with the shortest stop."""
        return Step(turn, self.menu.shortest_s, self.menu.acceleration_rad_s2)


@dataclass(frozen=True)
class Move:
    """A turn with a stop."""

    first: Turn | None
    """Turn with the shortest stop that leads there; None where the move is one by itself."""
    turn: Turn | None
    row: int
    """Of `worth`: the end of the stop."""
    rate: float
    """What it brings (nat/min), the turn that leads there counted."""
    elapsed_s: float
    dwell_s: float
    """`elapsed_s`, `dwell_s`: all that it takes, and its last stop (s)."""
    worth: Worth
    done: bool
    """Nothing is lacking after it."""


def needed_of(known: Knowledge) -> Floats:
    """Say what is lacking at the last look to tell the open class apart.

    Differences of log Bayes factors (1), one for each look-alike, shape (a,); empty where no class is open.
    """
    return np.zeros(0) if known.open is None else known.open.needed


def length_s(turn: Turn | None) -> float:
    """Duration of a turn (s); zero for none."""
    return 0.0 if turn is None else turn.duration_s


def moves(stand: Stand) -> list[Move]:
    """List what can be done in the time that is left.

    Where a class is open, what one turn hides from the next is looked for, too (`led`): an axis that stands upright
    shows little of a slow turn about it, and the turn that brings it level shows nothing by itself.
    """
    found = _from(stand, stand.at, None)
    return found if stand.known.open is None else found + led(stand)


def led(stand: Stand) -> list[Move]:
    """List moves after a turn that leads to them, none where the test stands between the axes.

    A table cannot turn about every axis from everywhere: an attitude that a limit needs may be two turns away.
    """
    found: list[Move] = []
    if not stand.at.square:
        return found
    turns = (Turn(axis, angle, stand.menu.rate_rad_s) for axis in "XYZ" for angle in _LEADING_RAD)
    for first in turns:
        if stand.possible(stand.step(first)) and _left_s(stand, first) > 0.0:
            acceleration = stand.menu.acceleration_rad_s2
            found += _from(stand, ahead(stand.at, first, stand.menu.shortest_s, acceleration).end, first)
    return found


def _left_s(stand: Stand, first: Turn | None) -> float:
    """Time that is left (s) after a turn that leads to another one."""
    return 60.0 * stand.minutes_left - (0.0 if first is None else length_s(first) + stand.menu.shortest_s)


def _from(stand: Stand, at: SoFar, first: Turn | None) -> list[Move]:
    """List single moves from a place; staying there is one only where no turn has led there."""
    menu = stand.menu
    before = () if first is None else (stand.step(first),)
    turns = (t for t in menu.turns(stand.known.open is not None, at.square) if stand.possible(*before, stand.step(t)))
    found = []
    for turn in (*(() if before else (None,)), *turns):
        longest = min(menu.longest_s, _left_s(stand, first) - length_s(turn))
        if longest < menu.shortest_s:
            continue
        try:
            told = ahead(at, turn, longest, menu.acceleration_rad_s2)
        except DataError:
            continue  # too fast for the acceleration
        move = _best(stand, first, turn, told)
        found += [] if move is None else [move]
    return found


def _best(stand: Stand, first: Turn | None, turn: Turn | None, told: Ahead) -> Move | None:
    """Choose the length of the stop after a turn: that which ends the test, else that with the most a minute."""
    long = told.dwell_s > stand.menu.shortest_s - 1e-6
    if not long.any():
        return None
    then = worth(stand.known, stand.goals, told.covariance, stand.known.at.covariance)
    spent = 0.0 if first is None else length_s(first) + stand.menu.shortest_s + _DECISION_S
    elapsed = told.elapsed_s + spent
    rate = np.where(long, 60.0 * (stand.now.lacking[0] - then.lacking) / (elapsed + _DECISION_S), -np.inf)
    done = np.flatnonzero(then.reached(needed_of(stand.known)) & long)
    row = int(done[0]) if len(done) else int(np.argmax(rate))
    return Move(
        first, turn, row, float(rate[row]), float(elapsed[row]), float(told.dwell_s[row]), then, bool(len(done))
    )
