"""Units and signs of a recording, recognised by what physics allows.

- **Unit of the force**: at rest its size is that of gravity, so a median near 9.8 is m/s^2 and one near 1 is g.
- **Unit and sense of the rate**: at rest before and after a turn the force points up; turned back by what the gyros say
  in between, both directions must agree. Radians and degrees differ by a factor of 57, and a wrong sense turns the
  wrong way, so no error of a sensor imitates either. Right-handed axes of any orientation (NED or ENU, forward-right-
  down or forward-left-up) all pass: they are rotations of each other. Left-handed axes turn the wrong way, as gyros
  of the wrong sign do.
- **Sign of the force**: turns do not show it, because a vector and its negative turn in the same way. The Earth
  does: its rate has the component Omega sin(latitude) along the upward force (`latitude_check`). Where the
  Earth's rate is not seen the sign changes nothing but the signs of the accelerometers' biases and of coefficients
  per g.

Sources: the attitude kinematics of a fixed vector, du/dt = -omega x u (Groves, *Principles of GNSS, Inertial, and
Multisensor Integrated Navigation Systems*, 2nd ed., section 2.3); Earth rate in local-level axes, section 2.4.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import permutations, product
from typing import NamedTuple

import numpy as np

from sdimu_calibration.core.arrays import Floats, Ints
from sdimu_calibration.core.data.blocks import median_length
from sdimu_calibration.core.data.windows import Windows, cut_windows, turned
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.units import STANDARD_GRAVITY, parse_unit
from sdimu_calibration.core.wording import Option, Work

DEGREE = float(np.pi / 180.0)
"""A degree (rad): what a driver of deg/s is off by."""
_NEAR_GRAVITY = 0.3
"""The median of |f| may differ from gravity by this share: nominal scale and bias of raw counts err so much."""
_OTHER_UNITS = ("mg", "ug", "cm/s^2", "mm/s^2")
"""Units of force beside m/s^2 and g that drivers write."""
_NO_GRAVITY = 0.2
"""Median of |f| (m/s^2 or g) that is refused: below it the driver has taken gravity away."""
_LENGTHS_S = (1.0, 4.0, 16.0, 64.0)
"""Lengths of windows (s), tried in turn: a hand turns in a second what a table turns in a minute."""
_FAR = np.radians(20.0)
"""Swing of the force (rad) that decides: well beyond what accelerations, misalignment and bias do to a direction."""
_LEAST_SWING = np.radians(5.0)
"""Least swing (rad) in the longest windows: smaller turns say nothing."""
_OTHERS = 2
"""A swing counts when so many others are as large: a single bump is no turn."""
_LARGE = 0.25
"""Share of the largest swing: windows that swing by more are turns."""
_NEARLY_ALL = 0.9
"""Share of the turns that must fit the axes: an IMU may turn about one of them in every tenth turn only."""
_MOST = 200_000
"""Number of samples at most: more decide nothing that these do not."""
_NO_RATE = 1e9
"""Reading of a gyro (any unit) from which it is no rate: a thousand times what the fastest give in deg/s, and more than
counters of 24 bits have."""
_RANGES = (0.125, 0.25, 0.5, 2.0, 4.0, 8.0)
"""Factors on the rates that a wrong setting of the range makes: ranges of gyros go by powers of two."""
_FITS, _FAILS = 0.4, 2.0
"""Share of the swing, and multiple of it: the right reading leaves less than the one, every other one more than the
other times as much."""


@dataclass(frozen=True)
class Stated:
    """What the user says of the numbers; None is to be recognised."""

    accel: float | None = None
    gyro: float | None = None
    """`accel`, `gyro`: m/s^2 and rad/s of one unit, positive."""
    accel_sign: int | None = None
    gyro_sign: int | None = None
    """`accel_sign`, `gyro_sign`: 1 or -1."""


@dataclass(frozen=True)
class Reading:
    """How the numbers are to be read: SI = factor * number."""

    accel: float
    gyro: float
    """`accel`, `gyro`: factors, with sign."""
    notes: tuple[str, ...]
    """What was recognised and is not what the message says, one line each; empty for SI of the usual sense."""
    turned: bool = True
    """The turns decided; False where no turn changes the direction of gravity."""


def recognise(t: Floats, w: Floats, f: Floats, stated: Stated) -> Reading:
    """Recognise units and senses.

    Parameters
    ----------
    t : ndarray, shape (n,)
        Seconds, ascending.
    w, f : ndarray, shape (n, 3)
        Body rate and specific force, as recorded.
    """
    accel, notes = _accel_unit(f, stated)
    gyro, more, turned_enough = _gyro_reading(t, w, f, stated)
    return Reading(accel * (stated.accel_sign or 1), gyro, (*notes, *more), turned_enough)


def _accel_unit(f: Floats, stated: Stated) -> tuple[float, tuple[str, ...]]:
    size = median_length(f)
    if stated.accel is not None:
        if not _is_gravity(size * stated.accel):
            raise DataError(
                f"linear_acceleration: with {Option.ACCEL_UNIT} the median of |f| is {size * stated.accel:.4g} m/s^2, "
                f"which is not gravity; check {Option.ACCEL_UNIT}"
            )
        return stated.accel, ()
    if _is_gravity(size):
        return 1.0, ()
    if _is_gravity(size * STANDARD_GRAVITY):
        return STANDARD_GRAVITY, (f"specific force is read in g: the median of |f| is {size:.4g}",)
    if size < _NO_GRAVITY:
        raise DataError(
            f"linear_acceleration: the median of |f| is {size:.3g}: there is no gravity in it; record the IMU's raw "
            "specific force"
        )
    fitting = [unit for unit in _OTHER_UNITS if _is_gravity(size * parse_unit(unit).factor)]
    advice = (
        f"{Option.ACCEL_UNIT} {fitting[0]} makes it gravity"
        if fitting
        else (
            f"no usual unit makes it gravity: either these are raw counts, {size / STANDARD_GRAVITY:.4g} of which are "
            f"1 m/s^2 (counts_per_unit in a map of {Work.IMPORT}), or the IMU hardly rests"
        )
    )
    raise DataError(
        f"linear_acceleration: the median of |f| is {size:.4g}, neither near 9.8 (m/s^2) nor near 1 (g); {advice}"
    )


def _is_gravity(size: float) -> bool:
    return abs(size / STANDARD_GRAVITY - 1.0) < _NEAR_GRAVITY


def _gyro_reading(t: Floats, w: Floats, f: Floats, stated: Stated) -> tuple[float, tuple[str, ...], bool]:
    """Recognise the factor of the gyros from the turns; also return whether there were any."""
    units = (1.0, DEGREE) if stated.gyro is None else (stated.gyro,)
    signs = (1.0, -1.0) if stated.gyro_sign is None else (float(stated.gyro_sign),)
    readings = [unit * sign for unit in units for sign in signs]
    seen: Turns | None = None
    for length_s in _LENGTHS_S:
        windows = cut_windows(t, w, f, length_s)
        turns = _turning(windows, _FAR if length_s < _LENGTHS_S[-1] else _LEAST_SWING)
        if not len(turns):
            continue
        # A table at an even rate may turn a wrong unit by whole turns more: windows of another length tell.
        now = Turns(windows, turns, {reading: turned(w, windows, turns, reading) for reading in readings}, w)
        best = now.best()
        if best is not None:
            now.check_axes(best)
            return best, _reading_notes(best, stated), True
        seen = seen or now
    if seen is None:
        note = "no turn changes the direction of gravity: unit and sense of the gyros are not checked"
        return readings[0], (note,), False
    raise DataError(_beyond_measure(t, w) or seen.undecided(stated))


def _beyond_measure(t: Floats, w: Floats) -> str:
    """Name the largest rate where it is none in any unit; empty otherwise."""
    rows = np.array([w.argmin(axis=0), w.argmax(axis=0)])
    values = np.take_along_axis(w, rows, axis=0)
    side, axis = np.unravel_index(int(np.argmax(np.abs(values))), values.shape)
    largest = float(values[side, axis])
    if abs(largest) < _NO_RATE:
        return ""
    at = t[rows[side, axis]]
    return (
        f"angular_velocity.{'xyz'[axis]} is {largest:.4g} at {at:.1f} s, which is no rate in any unit: "
        f"check the driver, or cut the recording before or after it ({Work.CUT})"
    )


def _largest(windows: Windows) -> float:
    return float(np.sort(windows.swing)[-1 - _OTHERS]) if len(windows) > _OTHERS else 0.0


def _turning(windows: Windows, enough: float) -> Ints:
    """Windows in which the direction of gravity changes most; none when it never changes by `enough` (rad)."""
    largest = _largest(windows)
    if largest < enough:
        return np.empty(0, dtype=np.int64)
    chosen = np.flatnonzero(windows.swing > _LARGE * largest)
    return np.asarray(chosen[:: max(-(-len(chosen) * windows.length // _MOST), 1)])


@dataclass(frozen=True)
class Turns:
    """Windows in which the IMU turned, and the rotation in each by every reading of the gyros."""

    windows: Windows
    chosen: Ints
    """Shape (k,)."""
    C: dict[float, Floats]
    """By factor, shape (k, 3, 3)."""
    w: Floats
    """Body rate as recorded, shape (n, 3)."""

    def misfit(self, reading: float, axes: Floats | None = None, share: float = 0.5) -> float:
        """Return what a reading leaves of the change of direction, as a share of it.

        Parameters
        ----------
        reading : float
            Factor of the gyros.
        axes : ndarray, shape (3, 3), optional
            From the axes of the gyros to those of the accelerometers, a rotation.
        share : float
            The misfit that so many of the windows stay below; by default the median, so that bumps do not count.
        """
        before, after = self.windows.up_first[self.chosen], self.windows.up_last[self.chosen]
        P = np.eye(3) if axes is None else axes
        predicted = np.einsum("ij,kmj,ml,kl->ki", P, self.C[reading], P.T, before, optimize=True)
        missed = np.linalg.norm(after - predicted, axis=1)
        return float(np.quantile(missed, share) / np.median(np.linalg.norm(after - before, axis=1)))

    def best(self) -> float | None:
        """Return the reading that fits where no other does; None when the turns do not decide."""
        left = {reading: self.misfit(reading) for reading in self.C}
        best, *others = sorted(left, key=lambda reading: left[reading])
        decided = left[best] < _FITS and all(left[other] > _FAILS * left[best] for other in others)
        return best if decided else None

    def check_axes(self, reading: float) -> None:
        """Refuse axes of which one disagrees: the median does not see it when the IMU seldom turns about it."""
        if self.misfit(reading, share=_NEARLY_ALL) < _FITS:
            return
        best, sense, axes = self._other_axes(_NEARLY_ALL)
        if best < _FITS and self.misfit(reading, share=_NEARLY_ALL) > _FAILS * best:
            raise DataError(_wrong_axes(axes * np.sign(sense)))

    def undecided(self, stated: Stated) -> str:
        """Say why the turns do not decide, and which axes would fit."""
        best, reading, axes = self._other_axes(_NEARLY_ALL)
        least = min(map(self.misfit, self.C))
        if best < _FITS and least > _FAILS * best:
            return _wrong_axes(axes * np.sign(reading))
        other = self._other_range(least)
        if other:
            return other
        options = "" if stated.gyro is not None else f"; state the unit, such as {Option.GYRO_UNIT} deg/s"
        return (
            f"angular_velocity: the turns do not agree with the change of gravity's direction ({least:.0%} of it is "
            f"left){options}; check that rate and force are of one rigid IMU and no axis is wrong"
        )

    def _other_range(self, least: float) -> str:
        """Say by what factor the rates are wrong, as after a wrong setting of the range; empty where none closes turns.

        Parameters
        ----------
        least : float
            What the readings without a factor leave.
        """
        scaled = {
            (factor, reading): replace(
                self, C={reading: turned(self.w, self.windows, self.chosen, factor * reading)}
            ).misfit(reading)
            for reading in self.C
            for factor in _RANGES
        }
        (factor, reading), second = sorted(scaled, key=lambda one: scaled[one])[:2]
        left = scaled[factor, reading]
        if left >= _FITS or min(scaled[second], least) <= _FAILS * left:
            return ""
        unit = "deg/s" if abs(abs(reading) - DEGREE) < 1e-9 else "rad/s"
        back = " of the opposite sign" if reading < 0.0 else ""
        return (
            f"angular_velocity: the turns close with {factor:g} times the rates{back} ({left:.0%} of the change of "
            f"gravity's direction is left, {least:.0%} as recorded): the range of the gyros is probably set wrong; "
            f"state {Option.GYRO_UNIT} '{factor:g} {unit}', or correct counts_per_unit in the map of {Work.IMPORT}"
        )

    def _other_axes(self, share: float) -> tuple[float, float, Floats]:
        found = ((self.misfit(r, P, share), r, P) for r in self.C for P in ROTATIONS)
        return min(found, key=lambda entry: entry[0])


def _wrong_axes(axes: Floats) -> str:
    return (
        "the turns contradict the axes: the gyros fit the accelerometers only when their axes are read as "
        f"({axes_in_words(axes)}); correct the driver, or import the data with the right signs"
    )


def _reading_notes(reading: float, stated: Stated) -> tuple[str, ...]:
    notes = []
    if stated.gyro is None and abs(reading) != 1.0:
        notes.append("body rate is read in deg/s: the turns then agree with the change of gravity's direction")
    if stated.gyro_sign is None and reading < 0.0:
        notes.append(
            "body rate is read with the opposite sign: as recorded the turns go the wrong way (gyros of the wrong "
            "sense, or left-handed axes)"
        )
    return tuple(notes)


class TurnsFit(NamedTuple):
    """With what the rates turn the force as it turns."""

    factor: float | None
    """rad/s of one number, positive; None where no turn tells it."""
    left: float
    """Share of the change of gravity's direction that is left."""
    signs: tuple[int, int, int]
    """1 or -1 of each gyro."""
    as_recorded: float
    """What is left with the signs as recorded, at best."""


AS_RECORDED = (1, 1, 1)
"""Signs of gyros of which none is reversed."""
NO_TURN = TurnsFit(None, 1.0, AS_RECORDED, 1.0)
"""What is said where no turn changes the direction of gravity."""


def fitting_scale(t: Floats, w: Floats, f: Floats, factors: Sequence[float], any_sense: bool = False) -> TurnsFit:
    """Find the factor on the rates with which the turns agree best with the change of gravity's direction.

    Parameters
    ----------
    t : ndarray, shape (n,)
        Seconds, ascending.
    w, f : ndarray, shape (n, 3)
        Body rate in any unit, specific force in any unit.
    factors : sequence of float
        rad/s of one unit of `w`.
    any_sense : bool
        Where no factor fits, also try gyros of which some are reversed.
    """
    for length_s in _LENGTHS_S:
        windows = cut_windows(t, w, f, length_s)
        chosen = _turning(windows, _FAR)
        if len(chosen):
            seen = Turns(windows, chosen, {k: turned(w, windows, chosen, k) for k in factors}, w)
            best = min(factors, key=seen.misfit)
            left = seen.misfit(best)
            reversed_ = _reversed(seen, best, factors) if any_sense else None
            return reversed_ or TurnsFit(best if left < _FITS else None, left, AS_RECORDED, left)
    return NO_TURN


def _reversed(seen: Turns, best: float, factors: Sequence[float]) -> TurnsFit | None:
    """Find the gyros that are reversed: without them nearly all turns fail, and with them they fit; None for none.

    Parameters
    ----------
    best : float
        The factor that fits best with the signs as recorded.
    """
    as_recorded = seen.misfit(best, share=_NEARLY_ALL)
    if as_recorded < _FITS:
        return None
    both = {k: turned(seen.w, seen.windows, seen.chosen, k) for factor in factors for k in (factor, -factor)}
    turns = replace(seen, C=both)
    fits = [_of_signs(turns, signs, factors, as_recorded) for signs in _SENSES]
    least = min(fit.left for fit in fits)
    if least >= _FITS or as_recorded <= _FAILS * least:
        return None
    # Of an axis that is not turned about no turn tells the sign.
    return next(fit for fit in fits if fit.left <= _FAILS * least)


def _of_signs(turns: Turns, signs: tuple[int, int, int], factors: Sequence[float], as_recorded: float) -> TurnsFit:
    """Fit turns with gyros of other signs; `turns` have the rotations of each factor in both senses."""
    # An even number of reversed gyros is a half turn of their axes; an odd number is that, and all of them reversed.
    sense = float(np.prod(signs))
    axes = np.diag(sense * np.array(signs))
    misfits = {factor: turns.misfit(sense * factor, axes) for factor in factors}
    factor = min(misfits, key=lambda k: misfits[k])
    return TurnsFit(factor, turns.misfit(sense * factor, axes, _NEARLY_ALL), signs, as_recorded)


_SENSES = ((-1, -1, -1), (-1, 1, 1), (1, -1, 1), (1, 1, -1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1))
"""Signs of gyros of which some are reversed, the likeliest first: a sense of all, one wire, two."""


def _signed_permutations() -> tuple[Floats, ...]:
    """Return the 24 rotations that exchange axes."""
    out = []
    for order, signs in product(permutations(range(3)), product((1.0, -1.0), repeat=3)):
        P = np.zeros((3, 3))
        P[range(3), order] = signs
        if np.linalg.det(P) > 0.0:
            out.append(P)
    return tuple(out)


ROTATIONS = _signed_permutations()
"""The 24 rotations that exchange axes, shape (3, 3) each."""


def axes_in_words(P: Floats) -> str:
    """Name the axes that the rows of a signed permutation pick, such as ``y, -x, z``.

    Parameters
    ----------
    P : ndarray, shape (3, 3)
    """
    return ", ".join(f"{'-' if row[k] < 0 else ''}{'xyz'[k]}" for row in P for k in np.flatnonzero(row))
