"""The next move: the one that brings most a minute, with the reason."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from sdimu_calibration.core.adaptive.goals import Goals
from sdimu_calibration.core.adaptive.knowledge import Knowledge
from sdimu_calibration.core.adaptive.so_far import Ahead, SoFar, ahead
from sdimu_calibration.core.adaptive.worth import Worth, worth
from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.plan import Turn
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.table import Step

FIRST_STOP_S = 20.0
"""First stop of a test (s): the azimuth is then known well enough for the passes to converge."""
_DECISION_S = 5.0
"""Time that a stop costs beside its length (s): fit and choice at its end; without it stops would be shortest."""
_NOTHING_NAT = 0.02
"""Gain of the best move (nat/min) below which a test ends that cannot reach its limits: an hour would bring one."""
_WORDS_NAT = 0.1
"""Gain (nat) from which a reason tells of a class: odds of 1.1 to 1."""


@dataclass(frozen=True)
class Menu:
    """Moves to choose from.

    Attributes
    ----------
    angles_rad, oblique_rad : tuple of float
        Signed angles of turns about each axis; those of turns to stops between the axes, from which the gimbals of a
        table can make few turns: only for what is to be told apart, and back.
    rate_rad_s : float
        Mean rate.
    slow_rad_s : float
        A second rate, for what is to be told apart: functions of the rate differ between two.
    shortest_s, longest_s : float
        Stops.
    """

    angles_rad: tuple[float, ...] = tuple(math.radians(a) for a in (90.0, -90.0, 180.0, -180.0))
    oblique_rad: tuple[float, ...] = tuple(math.radians(a) for a in (45.0, -45.0))
    rate_rad_s: float = math.radians(10.0)
    slow_rad_s: float = math.radians(2.0)
    acceleration_rad_s2: float = math.radians(20.0)
    shortest_s: float = 10.0
    longest_s: float = 60.0

    def turns(self, apart: bool, square: bool) -> tuple[Turn, ...]:
        """List the turns to choose from.

        Parameters
        ----------
        apart : bool
            Something is to be told apart.
        square : bool
            The test stands along the axes; between them it only goes back, or on.
        """
        angles = (*(self.angles_rad if square else ()), *(self.oblique_rad if apart or not square else ()))
        rates = (self.rate_rad_s, self.slow_rad_s) if apart else (self.rate_rad_s,)
        return tuple(Turn(axis, angle, rate) for axis in "XYZ" for angle in angles for rate in rates)


@dataclass(frozen=True)
class Choice:
    """What to do next.

    Attributes
    ----------
    step : Step
        Turn and stop, for the table.
    gain : float
        What it brings (nat).
    reason : str
        What it brings, in words.
    after : SoFar
        Where the test will then be, by the covariance alone.
    ratio : ndarray, shape (c,)
        Sigma of every coefficient with a limit over that limit, after it (1).
    told : float
        Part of the gain that tells a class apart (nat).
    done : bool
        Nothing will be lacking after it.
    """

    step: Step
    minutes: float
    gain: float
    reason: str
    after: SoFar
    ratio: Floats
    told: float
    done: bool

    @property
    def text(self) -> str:
        """Move and reason, such as ``X +90 deg at 10 deg/s, then dwell 30 s: tells A from B, 0.7 min``."""
        return f"{self.step.words}: {self.reason}, {self.minutes:.1f} min"


@dataclass(frozen=True)
class End:
    """The end of a test, and why.

    Attributes
    ----------
    reached : bool
        All limits hold, and no class is open.
    """

    reason: str
    reached: bool


@dataclass(frozen=True)
class _Option:
    turn: Turn | None
    row: int
    rate: float
    ahead: Ahead
    worth: Worth
    done: bool


def choose(
    known: Knowledge,
    goals: Goals,
    menu: Menu,
    minutes_left: float,
    possible: Callable[[Step], bool] = lambda _: True,
    at: SoFar | None = None,
) -> Choice | End:
    """Choose the next move.

    Parameters
    ----------
    known : Knowledge
        At the last stop that was looked at.
    minutes_left : float
        No move is longer.
    possible : callable
        ``Step -> bool``: whether the table can make it from where it stands.
    at : SoFar, optional
        Where moves since then have brought the test; by default nothing has moved.

    Returns
    -------
    Choice or End
        The end when nothing is lacking, or no move brings anything in the time that is left.
    """
    here = known.at if at is None else at
    now = worth(known, goals, here.covariance[None], known.at.covariance)
    needed = np.zeros(0) if known.open is None else known.open.needed
    if now.reached(needed)[0]:
        return End("all limits hold and nothing is to be told apart", reached=True)
    options = []
    turns = menu.turns(known.open is not None, here.square)
    for turn in (None, *(t for t in turns if possible(Step(t, menu.shortest_s, menu.acceleration_rad_s2)))):
        longest = min(menu.longest_s, 60.0 * minutes_left - _length(turn))
        if longest < menu.shortest_s:
            continue
        try:
            told = ahead(here, turn, longest, menu.acceleration_rad_s2)
        except DataError:
            continue  # too fast for the acceleration
        options.append(_best(turn, told, worth(known, goals, told.covariance, known.at.covariance), now, menu, needed))
    found = [one for one in options if one is not None]
    if not found:
        return End(f"the time is up; {_lacking(known, now)}", reached=False)
    # What ends the test soonest comes first, then what brings most a minute.
    best = min(found, key=lambda o: (not o.done, o.ahead.elapsed_s[o.row] if o.done else -o.rate))
    out_of_reach = most_gain(best.rate, goals.minutes, minutes_left) < now.lacking[0]
    if not best.done and best.rate < _NOTHING_NAT and out_of_reach:
        return End(f"no move of this table brings more; {_lacking(known, now)}", reached=False)
    return _choice(known, best, now, here, menu)


def most_gain(rate: float, minutes: float, left: float) -> float:
    """Bound what the time that is left can bring: information grows as time at best, and a gain is its logarithm.

    Parameters
    ----------
    rate : float
        What the best move brings now (nat/min).
    minutes, left : float
        Whole length of the test, and what is left of it (min).

    Returns
    -------
    float
        In nat; infinite at the start of the test.
    """
    done = minutes - left
    return math.inf if done <= 0.0 else rate * done * math.log(minutes / done)


def _length(turn: Turn | None) -> float:
    return 0.0 if turn is None else turn.duration_s


def _best(turn: Turn | None, told: Ahead, then: Worth, now: Worth, menu: Menu, needed: Floats) -> _Option | None:
    """Choose the length of the stop after a turn: that which ends the test, else that with the most a minute."""
    long = told.dwell_s > menu.shortest_s - 1e-6
    if not long.any():
        return None
    rate = np.where(long, 60.0 * (now.lacking[0] - then.lacking) / (told.elapsed_s + _DECISION_S), -np.inf)
    done = np.flatnonzero(then.reached(needed) & long)
    row = int(done[0]) if len(done) else int(np.argmax(rate))
    return _Option(turn, row, float(rate[row]), told, then, bool(len(done)))


def _choice(known: Knowledge, best: _Option, now: Worth, here: SoFar, menu: Menu) -> Choice:
    dwell = float(round(best.ahead.dwell_s[best.row]))
    reached = ahead(here, best.turn, dwell, menu.acceleration_rad_s2).end
    return Choice(
        Step(best.turn, dwell, menu.acceleration_rad_s2),
        (dwell + _length(best.turn)) / 60.0,
        float(now.lacking[0] - best.worth.lacking[best.row]),
        _reason(known, best, now),
        reached,
        best.worth.ratio[best.row],
        float(_told(known, best, now).sum()),
        best.done,
    )


def _lacking(known: Knowledge, now: Worth) -> str:
    """Say what a test that ends has not reached."""
    told = []
    worst = int(np.argmax(now.ratio[0]))
    if now.ratio[0, worst] > 1.0:
        told.append(f"{known.limited[worst]} is at {_times(now.ratio[0, worst])} of its limit")
    if known.open is not None:
        told.append(f"{known.open.found} is not told from {', '.join(known.open.alike)}")
    return " and ".join(told)


def _told(known: Knowledge, best: _Option, now: Worth) -> Floats:
    """Say how much of what is lacking a move adds to each difference of log Bayes factors, shape (a,)."""
    needed = np.zeros(0) if known.open is None else known.open.needed
    return np.asarray(np.minimum(best.worth.apart[best.row], needed) - np.minimum(now.apart[0], needed))


def _reason(known: Knowledge, best: _Option, now: Worth) -> str:
    """Say what a move brings most of: a class told apart, or a coefficient brought nearer to its limit."""
    told = []
    before, after = np.maximum(now.ratio[0], 1.0), np.maximum(best.worth.ratio[best.row], 1.0)
    nat = np.log(before / after)
    if known.open is not None:
        lacked = _told(known, best, now)
        if lacked.sum() > max(0.5 * nat.sum(), _WORDS_NAT):
            nearest = int(np.argmax(lacked))
            told.append(f"tells {known.open.found} from {known.open.alike[nearest]} ({lacked[nearest]:+.1f} nat)")
    if nat.max() > 0.0:
        i = int(np.argmax(nat))
        from_to = f"from {_times(now.ratio[0, i])} to {_times(best.worth.ratio[best.row, i])} of its limit"
        told.append(f"brings {known.limited[i]} {from_to}")
    return " and ".join(told) or "brings nothing"


def _times(ratio: float) -> str:
    return f"{ratio:.0f} times" if ratio > 9.5 else f"{ratio:.2f}"
