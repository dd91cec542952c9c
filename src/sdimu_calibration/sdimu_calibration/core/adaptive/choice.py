"""The next move: the one that brings most a minute, with the reason."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from sdimu_calibration.core.adaptive.goals import Goals
from sdimu_calibration.core.adaptive.knowledge import Knowledge
from sdimu_calibration.core.adaptive.menu import Menu
from sdimu_calibration.core.adaptive.move import Move, Stand, led, length_s, moves, needed_of
from sdimu_calibration.core.adaptive.so_far import SoFar, ahead
from sdimu_calibration.core.adaptive.worth import Worth, worth
from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.plain_text import first_of
from sdimu_calibration.core.table import Step

FIRST_STOP_S = 20.0
"""First stop of a test (s): the azimuth is then known well enough for the passes to converge."""
_NOTHING_NAT = 0.02
"""Gain of the best move (nat/min) below which a test ends that cannot reach its limits: an hour would bring one."""
_WORDS_NAT = 0.1
"""Gain (nat) from which a reason tells of a class: odds of 1.1 to 1."""
_MORE_DIGITS = 4
"""Digits that a reason may write a sigma over its limit in beyond the usual (1): a smaller difference tells nothing."""
_NAMED = 4
"""Number of effects in the model that a line names: more do not fit into it."""


@dataclass(frozen=True)
class Choice:
    """What to do next."""

    step: Step
    """Turn and stop, for the table."""
    minutes: float
    gain: float
    """What it brings (nat)."""
    reason: str
    """What it brings, in words."""
    after: SoFar
    """Where the test will then be, by the covariance alone."""
    ratio: Floats
    """Sigma of every coefficient with a limit over that limit, after it (1), shape (c,)."""
    told: float
    """Part of the gain that tells a class apart (nat)."""
    done: bool
    """Nothing will be lacking after it."""

    @property
    def text(self) -> str:
        """Move and reason, such as ``X +90 deg at 10 deg/s, then dwell 30 s: tells A from B, 0.7 min``."""
        return f"{self.step.words}: {self.reason}, {self.minutes:.1f} min"


@dataclass(frozen=True)
class End:
    """The end of a test, and why."""

    reason: str
    reached: bool
    """All limits hold, and no class is open."""


def choose(
    known: Knowledge,
    goals: Goals,
    menu: Menu,
    minutes_left: float,
    possible: Callable[..., bool] = lambda *_: True,
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
        ``*steps -> bool``: whether the table can make them, one after the other, from where it stands.
    at : SoFar, optional
        Where moves since then have brought the test; by default nothing has moved.

    Returns
    -------
    Choice or End
        The end when nothing is lacking, or no move brings anything in the time that is left.
    """
    stand = Stand(known, goals, menu, known.at if at is None else at, minutes_left, possible)
    now = stand.now
    if now.reached(needed_of(known))[0]:
        return End(f"all limits hold{_beside(known.named)} and nothing is to be told apart", reached=True)
    found = moves(stand)
    if not found:
        return End(f"the time is up; {_lacking(known, now)}", reached=False)
    best = _best_of(found)
    if known.open is None and not _within_reach(best, stand):
        # Two turns may bring what no single one does; with a class open they were looked at.
        best = _best_of([best, *led(stand)])
    if best.rate < _NOTHING_NAT and not _within_reach(best, stand):
        nearer = _to_limits(found, stand)
        if nearer is None:
            return End(f"no move of this table brings more; {_lacking(known, now)}", reached=False)
        best = nearer
    return _choice(stand, best)


def _best_of(found: list[Move]) -> Move:
    """Choose what ends the test soonest, else what brings most a minute."""
    return min(found, key=lambda o: (not o.done, o.elapsed_s if o.done else -o.rate))


def _within_reach(best: Move, stand: Stand) -> bool:
    """Whether moves like the best one could bring all that is lacking in the time that is left."""
    most = most_gain(best.rate, stand.goals.minutes, stand.minutes_left)
    return best.done or most >= stand.now.lacking[0]


def _to_limits(found: list[Move], stand: Stand) -> Move | None:
    """Choose what brings most a minute to the limits alone; None where they hold or are out of reach.

    A class that no turn tells apart, such as a delay and a sensitivity to angular acceleration, ends no test whose
    limits are near.
    """
    lacking = stand.now.beyond[0]
    rate, best = max(
        ((60.0 * (lacking - move.worth.beyond[move.row]) / move.elapsed_s, move) for move in found),
        key=lambda one: float(one[0]),
    )
    near = most_gain(float(rate), stand.goals.minutes, stand.minutes_left) >= lacking > 0.0
    return best if near else None


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


def _choice(stand: Stand, best: Move) -> Choice:
    """Make the first step of a move the choice: with the stop after it that was found, or to go on from at once."""
    known, now, menu = stand.known, stand.now, stand.menu
    turn, dwell, reason = best.turn, float(round(best.dwell_s)), _reason(known, best, now)
    then = best.worth, best.row
    if best.first is not None:
        reason = f"leads to {Step(turn, dwell, menu.acceleration_rad_s2).words}, which {reason}"
        turn, dwell = best.first, menu.shortest_s
    reached = ahead(stand.at, turn, dwell, menu.acceleration_rad_s2).end
    if best.first is not None:
        then = worth(known, stand.goals, reached.covariance[None], known.at.covariance), 0
    after, row = then
    return Choice(
        Step(turn, dwell, menu.acceleration_rad_s2),
        (dwell + length_s(turn)) / 60.0,
        float(now.lacking[0] - after.lacking[row]),
        reason,
        reached,
        after.ratio[row],
        float(_told(known, after, row, now).sum()),
        best.done and best.first is None,
    )


def _beside(named: Sequence[str]) -> str:
    """Say with what in the model limits hold: a calibration without it has other sigmas."""
    return f" with {first_of(named, _NAMED)} in the model" if named else ""


def _lacking(known: Knowledge, now: Worth) -> str:
    """Say what a test that ends has not reached."""
    told = []
    worst = int(np.argmax(now.ratio[0]))
    if now.ratio[0, worst] > 1.0:
        told.append(f"{known.limited[worst]} is at {_times(now.ratio[0, worst])[0]} of its limit")
    if known.open is not None:
        told.append(f"{known.open.found} is not told from {', '.join(known.open.alike)}")
    return " and ".join(told)


def _told(known: Knowledge, then: Worth, row: int, now: Worth) -> Floats:
    """Say how much of what is lacking a move adds to each difference of log Bayes factors, shape (a,)."""
    needed = needed_of(known)
    return np.asarray(np.minimum(then.apart[row], needed) - np.minimum(now.apart[0], needed))


def _reason(known: Knowledge, best: Move, now: Worth) -> str:
    """Say what a move brings most of: a class told apart, or a coefficient brought nearer to its limit."""
    told = []
    before, after = np.maximum(now.ratio[0], 1.0), np.maximum(best.worth.ratio[best.row], 1.0)
    nat = np.log(before / after)
    if known.open is not None:
        lacked = _told(known, best.worth, best.row, now)
        if lacked.sum() > max(0.5 * nat.sum(), _WORDS_NAT):
            nearest = int(np.argmax(lacked))
            told.append(
                f"tells {known.open.found} from {known.open.alike[nearest]} (expected evidence "
                f"{lacked[nearest]:+.1f} nat, the log of the odds)"
            )
        elif lacked.sum() > 0.0 and not nat.max() > 0.0:
            told.append(f"adds the rest that tells {known.open.found} from {known.open.alike[int(np.argmax(lacked))]}")
    if nat.max() > 0.0:
        i = int(np.argmax(nat))
        old, new = _times(now.ratio[0, i], best.worth.ratio[best.row, i])
        told.append(f"brings {known.limited[i]} from {old} to {new} of its limit")
    return " and ".join(told) or "brings nothing"


def _times(*ratios: float) -> list[str]:
    """Write sigmas over a limit (1) in as many digits as show that they differ from each other and from the limit."""
    written = []
    for more in range(_MORE_DIGITS + 1):
        written.append([f"{r:.{more}f} times" if r > 9.5 else f"{r:.{2 + more}f}" for r in ratios])
        if len({*written[-1], f"{1.0:.{2 + more}f}"}) > len(ratios):
            return written[-1]
    return written[0]
