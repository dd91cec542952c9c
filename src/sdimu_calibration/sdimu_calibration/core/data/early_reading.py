"""Units and signs of a test that is still going on: decided as soon as its samples decide, by `recognise`."""

from __future__ import annotations

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.data.axes_and_units import Reading, Stated, recognise
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.wording import Option

_FIRST_S = 1.0
"""Time after the origin of the first attempt (s), and least time between two: the beat of the filter."""
_GROWTH = 1.1
"""Factor on the time from attempt to attempt: all attempts together look at each sample eleven times at most."""
_NOTE_S = 5.0
"""Wait (s) from which a note says so: a shorter one nobody notices."""
_HELD = 2_000_000
"""Number of samples that wait for the decision at most, 0.1 GB: 2.8 hours at 200 Hz."""
_TICK_S = 1e-9
"""Resolution of stamps (s): they are integers of ns."""


class EarlyReading:
    """How the numbers of a running test are to be read, and the samples that wait for the decision.

    Attempts are made at fixed times, each with the samples up to then, so that the decision does not depend on how
    the samples arrived.

    Parameters
    ----------
    stated : Stated
        What is stated needs no decision.
    """

    def __init__(self, stated: Stated) -> None:
        self._stated = stated
        self._held: list[tuple[Floats, Floats, Floats]] = []
        self._attempt_s = _FIRST_S
        self._noted = False
        self.notes: list[str] = []
        """What the caller should publish; the caller empties the list."""
        self.gave_up = False
        """Too many samples have waited: the end of the test decides."""
        self.reading: Reading | None = None
        if stated.accel and stated.gyro and stated.gyro_sign:
            self.reading = Reading(stated.accel * (stated.accel_sign or 1), stated.gyro * stated.gyro_sign, ())

    def read(
        self, t: Floats, omega: Floats, force: Floats, until_s: float, final: bool
    ) -> tuple[Floats, Floats, Floats] | None:
        """Take samples, and give them back in SI once it is clear how they are to be read.

        Parameters
        ----------
        t : ndarray, shape (n,)
            Seconds after the origin, ascending, at most `until_s`.
        omega, force : ndarray, shape (n, 3)
            Body rate and specific force in the unit and sign of the messages.
        until_s : float
            Time up to which all samples have been given (s).
        final : bool
            No more will come: what no turn decides is read as it stands.

        Returns
        -------
        (ndarray, ndarray, ndarray), shapes (n,), (n, 3) and (n, 3), or None
            The samples since the last answer: time (s), rate (rad/s), force (m/s^2); None while they wait.
        """
        if self.reading is None:
            self._held.append((t, omega, force))
            if not self._decide(until_s, final):
                self._give_up_in_time(until_s)
                return None
            t, omega, force = (np.concatenate(part) for part in zip(*self._held, strict=True))
            self._held = []
        assert self.reading is not None
        return t, omega * self.reading.gyro, force * self.reading.accel

    def _decide(self, until_s: float, final: bool) -> bool:
        """Make the attempts that are due, at the end of the test one with all samples."""
        while self._attempt_s <= until_s + _TICK_S:
            if self._attempt(self._attempt_s, final=False):
                return True
            self._attempt_s = max(self._attempt_s + _FIRST_S, float(np.floor(_GROWTH * self._attempt_s)))
        return final and self._attempt(until_s, final=True)

    def _give_up_in_time(self, at_s: float) -> None:
        """Let go of samples that have waited for too long: memory is for the test, not for the filter on the way."""
        if sum(len(t) for t, _, _ in self._held) > _HELD:
            self.gave_up, self._held = True, []
            self.notes.append(
                f"no turn in {at_s:.0f} s: the filter on the way gives up; the end of the test is calibrated all the "
                f"same ({Option.GYRO_UNIT} and {Option.GYRO_SIGN} start it at once)"
            )

    def _attempt(self, at_s: float, final: bool) -> bool:
        """Try to recognise from the samples up to a time (s)."""
        t, omega, force = (np.concatenate(part) for part in zip(*self._held, strict=True))
        rows = slice(0, int(np.searchsorted(t, at_s + _TICK_S)))
        why = (
            "no turn has changed the direction of gravity yet, so unit and sign of the gyros are unknown; state both "
            f"({Option.GYRO_UNIT}, {Option.GYRO_SIGN}) to start at once"
        )
        try:
            reading = recognise(t[rows], omega[rows], force[rows], self._stated) if rows.stop > 1 else None
        except DataError as error:
            reading, why = None, str(error)
        gyros_are_stated = self._stated.gyro is not None and self._stated.gyro_sign is not None
        if reading is not None and (reading.turned or gyros_are_stated or final):
            self.reading = reading
            # That nothing has turned yet is no news while the test goes on.
            self.notes += reading.notes if reading.turned or final else reading.notes[:-1]
            if self._noted:
                self.notes.append(f"the filter starts with the samples of {at_s:.0f} s")
            return True
        if at_s >= _NOTE_S and not self._noted:
            self._noted = True
            self.notes.append(f"the filter waits: {why}")
        return False
