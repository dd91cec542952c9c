"""What a table does next, block by block: a plan, or goals as they come. Time is the number of samples sent."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from rate_table_sim.core.attitude import attitude_of, first_orientation
from rate_table_sim.core.goal import AxisState, Goal, GoalPoint, braking_point, goal_samples
from rate_table_sim.core.motion import Encoder, TableMotion, grid_times
from rate_table_sim.core.specification import TableSpecification
from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.recording import DataError

_ROUNDING = 1e-6
"""A time this close to a sample (in samples) is on it (1)."""


class Programme(Protocol):
    """Motion that can be sent now."""

    @property
    def available(self) -> int:
        """How many samples there are."""

    @property
    def over(self) -> bool:
        """Whether nothing comes after them."""

    def time_of(self, count: int) -> float:
        """Time (s) of the last of the next `count` samples."""

    def block(self, count: int) -> TableMotion:
        """Take the next `count` samples."""


class PlanProgramme:
    """A plan from beginning to end."""

    def __init__(self, motion: TableMotion) -> None:
        self._motion, self._next = motion, 0
        self.over = True

    @property
    def available(self) -> int:
        """How many samples there are."""
        return len(self._motion.t) - self._next

    def time_of(self, count: int) -> float:
        """Time (s) of the last of the next `count` samples."""
        return float(self._motion.t[self._next + count - 1])

    def block(self, count: int) -> TableMotion:
        """Take the next `count` samples."""
        here = slice(self._next, self._next + count)
        self._next += count
        arrays = {name: values[here] for name, values in vars(self._motion).items() if name != "names"}
        return replace(self._motion, **arrays)


@dataclass(frozen=True)
class _Ahead:
    """Samples to come: where the axes and the platform will be."""

    angle: Floats
    rate: Floats
    q_nt: Floats
    omega: Floats

    def __len__(self) -> int:
        return len(self.angle)

    def part(self, first: int, stop: int | None = None) -> _Ahead:
        """Return some of the samples."""
        here = slice(first, stop)
        return _Ahead(self.angle[here], self.rate[here], self.q_nt[here], self.omega[here])

    def then(self, more: _Ahead) -> _Ahead:
        """Return these samples and more."""
        pairs = ((getattr(self, name), getattr(more, name)) for name in self.__dataclass_fields__)
        return _Ahead(*(np.concatenate(pair) for pair in pairs))


class GoalProgramme:
    """Goals as they come: the table plays one to its last point, and stands still in time and place until the next."""

    def __init__(self, table: TableSpecification, seed: int) -> None:
        self._table, self._attitude, self._encoder = table, attitude_of(table), Encoder(table.imperfections, seed)
        zero = np.zeros((1, 3))
        self._ahead = _Ahead(zero, zero, first_orientation(table)[None, :], zero)
        self._last = self._ahead
        self._sent = self._stop = 0
        self._dwelling = True
        self._interrupted: tuple[GoalPoint, ...] = ()
        self.goal: Goal | None = None
        """The goal that is being carried out."""
        self.halted = ""
        """``held`` or ``stopped`` since somebody asked for it; empty otherwise."""
        self.over = False

    @property
    def available(self) -> int:
        """How many samples there are."""
        return len(self._ahead)

    @property
    def now_s(self) -> float:
        """Time (s) of the last sample sent."""
        return self._time(max(self._sent - 1, 0))

    @property
    def end_angle(self) -> Floats:
        """Where the axes are at the end of what there is, shape (3,) (rad)."""
        return np.asarray((self._ahead if len(self._ahead) else self._last).angle[-1])

    def time_of(self, count: int) -> float:
        """Time (s) of the last of the next `count` samples."""
        return self._time(self._sent + count - 1)

    def take(self, goal: Goal) -> Goal | None:
        """Accept a goal: it begins at the next sample, or at its own time. Gives the goal that it replaces."""
        if self.halted == "stopped":
            raise DataError("the table was stopped: call the service resume first")
        if self.over:
            raise DataError("the test was finished: the table takes no more goals")
        if not goal.points:
            raise DataError("the trajectory has no points")
        rate_hz = self._table.sample_rate_hz
        first = self._sent if goal.start_s is None else math.ceil(goal.start_s * rate_hz - _ROUNDING)
        points = goal.points
        if first < self._sent:
            points = _still_to_come(goal, self._time(self._sent))
            first = self._sent
        kept = self._until(first)
        made = self._made(points, kept.part(-1))
        replaced, self._interrupted = self.goal, ()
        self._ahead, self.goal, self.halted = kept.then(made), goal, ""
        return replaced

    def hold(self) -> bool:
        """Come to rest within the limits; what is left of the goal waits for `resume`. False when nothing moved."""
        moves = bool(self._ahead.rate.any())
        if self.halted or self.goal is None:
            return False
        self._interrupted = _rest_of(self.goal, self._ahead, self._table.sample_rate_hz)
        self._brake()
        self.halted = "held"
        return moves

    def stop(self) -> Goal | None:
        """Come to rest within the limits, forget the goal, and take no other until `resume`; the goal forgotten."""
        forgotten, self.goal, self._interrupted = self.goal, None, ()
        self._brake()
        self.halted = "stopped"
        return forgotten

    def resume(self) -> Goal | None:
        """Go on with the goal that was held: from rest to its last point, then its dwell; the goal, if there is one."""
        self.halted = ""
        if not self._interrupted:
            return None
        end = self._ahead if len(self._ahead) else self._last
        points = _timed(self._interrupted, end.angle[-1], self._table)
        self._ahead = self._ahead.then(self._made(points, end.part(-1)))
        self._interrupted = ()
        return self.goal

    def rest(self, count: int) -> None:
        """Let time run at rest for `count` samples."""
        end = self._ahead if len(self._ahead) else self._last
        self._ahead = self._ahead.then(_standing(end, count))

    def finish(self) -> None:
        """Take no more goals; the programme is over when what there is has been sent."""
        self.over = True

    def block(self, count: int) -> TableMotion:
        """Take the next `count` samples."""
        taken, rest = self._ahead.part(0, count), self._ahead.part(count)
        after = rest.angle[:1] if len(rest) else taken.angle[-1:]
        moves = np.any(np.diff(np.vstack([taken.angle, after]), axis=0) != 0.0, axis=1)
        still = ~(moves | taken.rate.any(axis=1))
        arrived = still & ~np.r_[self._dwelling, still[:-1]]
        stop = self._stop + np.cumsum(arrived)
        t = grid_times(self._sent, self._sent + count, self._table.sample_rate_hz)
        self._stop, self._dwelling = int(stop[-1]), bool(still[-1])
        self._sent, self._last, self._ahead = self._sent + count, taken.part(-1), rest
        return TableMotion(
            t,
            taken.angle,
            taken.rate,
            self._encoder.read(taken.angle),
            stop,
            still,
            taken.q_nt,
            taken.omega,
            self._table.axis_names,
        )

    def reached(self) -> Goal | None:
        """Return the goal whose last sample has been sent, once."""
        if self.goal is None or self._interrupted or len(self._ahead):
            return None
        goal, self.goal = self.goal, None
        return goal

    def _time(self, index: int) -> float:
        return float(grid_times(index, index + 1, self._table.sample_rate_hz)[0])

    def _until(self, first: int) -> _Ahead:
        """Return the samples up to and with the one of index `first`; at rest after the goal there is."""
        count = first - self._sent + 1
        if count <= len(self._ahead):
            return self._ahead.part(0, count)
        end = self._ahead if len(self._ahead) else self._last
        return self._ahead.then(_standing(end, count - len(self._ahead)))

    def _made(self, points: tuple[GoalPoint, ...], at: _Ahead) -> _Ahead:
        state = AxisState(at.angle[-1], at.rate[-1])
        table = self._table
        angle, rate = goal_samples(points, state, table.limits, table.axis_names, table.sample_rate_hz)
        q_nt, omega = self._attitude.motion(angle, rate, at.angle[-1], at.q_nt[-1])
        return _Ahead(angle, rate, q_nt, omega)

    def _brake(self) -> None:
        """Replace what is to come by the shortest way to rest."""
        at = self._last if self._sent else self._ahead
        self._ahead = self._ahead.part(0, 0) if self._sent else self._ahead.part(0, 1)
        if at.rate[-1].any():
            state = AxisState(at.angle[-1], at.rate[-1])
            point = braking_point(state, self._table.limits, self._table.sample_rate_hz)
            self._ahead = self._made((point,), at)


def _standing(end: _Ahead, count: int) -> _Ahead:
    at, still = end.part(-1), np.zeros((count, 3))
    return _Ahead(np.repeat(at.angle, count, 0), still, np.repeat(at.q_nt, count, 0), still.copy())


def _still_to_come(goal: Goal, now_s: float) -> tuple[GoalPoint, ...]:
    """Points of a goal that began in the past, timed from now; DataError when there are none."""
    assert goal.start_s is not None
    late = now_s - goal.start_s
    points = tuple(replace(p, time_s=p.time_s - late) for p in goal.points if p.time_s > late + _ROUNDING)
    if not points:
        raise DataError(f"the trajectory ends {late - goal.points[-1].time_s:.4g} s in the past")
    return points


def _rest_of(goal: Goal, ahead: _Ahead, rate_hz: float) -> tuple[GoalPoint, ...]:
    """Keep what a held goal leaves: its target, the largest rates still to come, and what is left of its dwell."""
    times = [p.time_s for p in goal.points if np.array_equal(p.angle, goal.points[-1].angle)]
    moves = bool(ahead.rate.any())
    dwell_s = times[-1] - times[0] if moves else len(ahead) / rate_hz
    fastest = np.abs(ahead.rate).max(axis=0) if moves else np.zeros(3)
    return (GoalPoint(dwell_s, goal.points[-1].angle, fastest),)


def _timed(left: tuple[GoalPoint, ...], here: Floats, table: TableSpecification) -> tuple[GoalPoint, ...]:
    """Points from rest to the target at no more than the rates that were to come, then the dwell."""
    (goal,) = left
    assert goal.rate is not None
    limits = np.array([one.acceleration_rad_s2 for one in table.limits])
    away = np.abs(goal.angle - here)
    rate = np.where(goal.rate > 0.0, goal.rate, [one.rate_rad_s for one in table.limits])
    # A trapezoid at that rate and the limit, or the triangle where the way is short.
    length = np.where(away > rate**2 / limits, away / rate + rate / limits, 2.0 * np.sqrt(away / limits))
    samples = math.ceil(float(length.max()) * table.sample_rate_hz) + 2 if away.any() else 0
    turn_s, dwell_s = samples / table.sample_rate_hz, goal.time_s
    points = [GoalPoint(turn_s, goal.angle)] if samples else []
    return (*points, *([GoalPoint(turn_s + dwell_s, goal.angle)] if dwell_s > 0.0 or not points else []))
