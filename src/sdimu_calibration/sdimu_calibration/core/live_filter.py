"""The filter on the way, epoch by epoch; passes over everything so far put its past right.

Between passes it feeds coefficients, position and velocity back; the error of the attitude stays a state. Its samples
are corrected exactly at the coefficients of the last pass, so that what it leaves out are squares of what it has
learned since.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from sdimu_calibration.core import earth
from sdimu_calibration.core.alignment.alignment import Alignment, levelled
from sdimu_calibration.core.alignment.coarse_alignment import StartPoint
from sdimu_calibration.core.alignment.prepared import measurement_kinds
from sdimu_calibration.core.arrays import Bools, Floats, Ints
from sdimu_calibration.core.data.epochs import Epochs
from sdimu_calibration.core.data.gaps import bridges, largest_acceleration
from sdimu_calibration.core.data.phases import RESTART_S, Phases
from sdimu_calibration.core.effects.error_slope import slope_is_constant
from sdimu_calibration.core.effects.motion import Motion
from sdimu_calibration.core.filter.filter_pass import COPY, NAV, PassInput, PassState, new_output, run_pass
from sdimu_calibration.core.filter.pass_loop import furthest_move
from sdimu_calibration.core.filter.pass_setup import check_finite, firm_setup, no_shifts, pass_settings, start_state
from sdimu_calibration.core.filter.passes import PIECE
from sdimu_calibration.core.live_history import Kept, LiveHistory
from sdimu_calibration.core.live_model import LiveModel
from sdimu_calibration.core.live_passes import passes_so_far
from sdimu_calibration.core.navigation.correct_cycles import corrected, slope_weight, spread
from sdimu_calibration.core.navigation.strapdown import Cycles
from sdimu_calibration.core.navigation.track import Correction, Surroundings, motion
from sdimu_calibration.core.recording import DataError, TemperatureLog
from sdimu_calibration.core.rotation import orthonormal, rotation_matrix

_EVERY = 5
"""Number of measured epochs (1), of one stop or of several short ones, from one look whether passes are due to the
next: the first seconds of a stop tell most, and looking takes time."""
_MOVED = 1.0
"""Movement since the last pass (sigma) from which passes are due: below it the next second of data counts for more."""
_GROWN = 1.1
"""Length of the test over that at the last passes (1) from which others are due: right after some the estimate still
moves, and passes five seconds later took what the next stop needed (mems_consumer was 10 sigma off after 6 stops)."""
_SHARE = 6.0
"""Epochs that all passes may take in, over those that have come (1): their work is then a third of the filter's."""
_AT_ONCE = 3000.0
"""Epochs (1) that passes may take in beside that share: while a test is short there are as many as it wants."""


@dataclass(frozen=True)
class Measured:
    """Samples of an epoch as the filter takes them: corrected, with what they become by the coefficients."""

    cycles: Cycles
    values: Floats
    """Regressors (SI), shape (n, m)."""
    channel: Ints
    parameter: Ints
    """`channel`, `parameter`: sensor axis and coefficient of each regressor, shape (m,)."""


class LiveFilter:
    """The filter on the way.

    Attributes
    ----------
    nis : ndarray, shape (4,)
        Squared normalised innovations of the last epoch (1), NaN where not measured.
    """

    def __init__(self, model: LiveModel, interval_s: float, alignment: Alignment) -> None:
        setup = model.setup
        self._model, self._interval_s, self._alignment = model, interval_s, alignment
        self._settings = pass_settings(firm_setup(setup), model.averaged)
        self._reference = np.zeros(len(setup.sensors.prior))
        self._weight: Floats | None = None
        self._C_start = alignment.C_nb.copy()
        self._deviation = start_state(setup, alignment, alignment.C_nb, self._reference)
        self._track = alignment.C_nb.copy()
        self._before: Motion | None = None
        self._acceleration = self._rested_s = 0.0
        self._history = LiveHistory()
        self._turned, self._unasked = False, 0
        self._loose, self._epochs, self._work, self._looked = True, 0, 0, 0
        self._stood, self._force = 0, np.zeros(3)
        self._C_stop: Floats | None = None
        self._begun = (-1, 0.0, 0)  # present stop: its number, its first measured second, how often it began anew
        self.nis = np.full(4, np.nan)

    @property
    def state(self) -> PassState:
        """State after the last epoch, coefficients in full."""
        x = self._deviation.x.copy()
        C_nb = orthonormal(rotation_matrix(x[6:NAV].copy()) @ self._deviation.C_nb)
        x[6:NAV] = 0.0
        return self._deviation._replace(x=x, C_nb=C_nb, used=self._reference + self._deviation.used)

    def take(self, cycles: Cycles, epochs: Epochs, phases: Phases, k: int, temperature: TemperatureLog | None) -> None:
        """Take epoch `k` of those that were cut from `cycles`."""
        setup = self._model.setup
        part = cycles[slice(int(epochs.first[k]), int(epochs.last[k]))]
        one = Phases(*(getattr(phases, n)[k : k + 1] for n in Phases.__dataclass_fields__))
        kind = measurement_kinds(one, setup.model.zero_velocity == "every_epoch")
        # The largest acceleration so far; a first gap in the first turn knows no more than that turn's beginning.
        self._acceleration = max(self._acceleration, largest_acceleration(part))
        alone = Epochs(
            np.zeros(1, dtype=np.int64),
            np.full(1, len(part), dtype=np.int64),
            *(getattr(epochs, n)[k : k + 1] for n in ("start", "end", "peak_rate", "f_mean", "w_mean")),
        )
        gap = bridges(part, alone, one.dwell, self._interval_s, self._acceleration, setup.gravity)
        kept = Kept(part, alone, one, kind, gap)
        self._history.add(kept, temperature)
        self._run(kept, self._measured(part, bool(one.dwell[0]), setup.around(temperature)))
        self._epochs += 1
        self._turned = self._turned or not one.dwell[0]
        self._unasked += bool(self._stood)
        if self._stood and self._turned and self._unasked >= _EVERY:
            self._unasked = 0
            if self._due():
                self._look_back()

    def _due(self) -> bool:
        """Whether the estimate has moved so far that passes are worth their work, and what they take is left."""
        spent = self._work + self._epochs > _SHARE * self._epochs + _AT_ONCE
        if self._history.closed or spent or self._epochs < _GROWN * self._looked:
            return False
        state = self._deviation
        moved = np.concatenate([np.zeros(NAV), state.used, state.x[-COPY:]])
        rows = np.flatnonzero(np.concatenate([np.zeros(NAV), self._model.constant, np.ones(COPY)]))
        return furthest_move(moved[rows], state.P[np.ix_(rows, rows)]) > _MOVED

    def _run(self, one: Kept, seen: Measured) -> None:
        """Run the filter over an epoch."""
        seconds = float(one.epochs.end[0] - one.epochs.start[0]) if one.phases.dwell[0] else 0.0
        self._rested_s += seconds
        data = PassInput(
            seen.cycles.dt,
            seen.cycles.alpha,
            seen.cycles.upsilon,
            seen.cycles.coning,
            seen.cycles.sculling,
            one.epochs.first,
            one.epochs.last,
            one.bridges.white,
            one.bridges.angle,
            one.bridges.velocity,
            one.kind,
            self._restart(one),
            seen.values,
            seen.channel,
            seen.parameter,
            *self._shift(one, seen),
            np.array([seconds / self._rested_s if seconds else 0.0]),
        )
        out = new_output(1, len(self._reference), False, 1)
        run_pass(data, self._settings, self._deviation, out)
        check_finite(self._deviation)
        used, x = self._deviation.used, self._deviation.x
        used[:] += x[NAV:-COPY]
        x[NAV:-COPY] = 0.0
        self.nis = out.nis[0]

    def _restart(self, one: Kept) -> Bools:
        """Whether navigation begins anew, as of `phases.restarts`, shape (1,)."""
        if not one.phases.used[0]:
            return np.zeros(1, dtype=bool)
        stop, start = int(one.phases.stop[0]), float(one.epochs.start[0])
        if stop != self._begun[0]:
            self._begun = (stop, start, 0)
        count = int((start - self._begun[1] + 1e-6) // RESTART_S)
        again, self._begun = count > self._begun[2], (*self._begun[:2], count)
        return np.array([again])

    def _shift(self, one: Kept, seen: Measured) -> tuple[Ints, Floats]:
        """Level the stop by what its force has been so far, and go on from there every few epochs, as a pass does."""
        if not one.phases.used[0]:
            self._force[:], self._stood, self._C_stop = 0.0, 0, None
            return no_shifts(1)
        self._force += seen.cycles.upsilon.sum(axis=0)
        self._stood += 1
        self._C_stop = levelled(self._deviation.C_nb if self._C_stop is None else self._C_stop, self._force)
        if self._stood % PIECE != 1:
            return no_shifts(1)
        return np.zeros(1, dtype=np.int64), self._C_stop[None].copy()

    def _measured(self, part: Cycles, rests: bool, around: Surroundings) -> Measured:
        """Correct the cycles of an epoch at the reference, and say what they become by the coefficients."""
        sensors, rest = self._model.setup.sensors, np.full(len(part), rests)
        if self._model.azimuth_free or self._weight is not None:
            # The Earth's rate is seen along the attitude: that of the samples as they come is off by the gyro biases.
            self._track[:, :] = self._deviation.C_nb
        none = Correction(sensors, np.zeros(len(sensors.prior)))
        if self._weight is None:
            seen = motion(part, rest, none, self._track, around, predicted=False, before=self._before, causal=True)
            self._before = seen
            return Measured(part, sensors.regressors(seen), sensors.channel, sensors.parameter)
        near = self._at_rest(part, around) if rests else self._in_motion(part, none, around)
        seen = motion(near, rest, none, self._track.copy(), around, predicted=rests, before=self._before, causal=True)
        values = sensors.regressors(seen)
        weight = self._weight_along(seen)
        clean = corrected(part, seen, weight, sensors.errors(values, self._reference))
        self._before = seen
        return Measured(clean.cycles, *spread(values, sensors.channel, sensors.parameter, weight))

    def _weight_along(self, seen: Motion) -> Floats:
        """`slope_weight` at the reference, made once where it is the same everywhere."""
        assert self._weight is not None
        if not len(self._weight):
            return slope_weight(seen, self._model.setup.sensors, self._reference)
        return np.ascontiguousarray(np.broadcast_to(self._weight, (len(seen.t), 6, 6)))

    def _at_rest(self, part: Cycles, around: Surroundings) -> Cycles:
        """Cycles as a perfect IMU would measure them in the present attitude."""
        w = earth.earth_rate(around.latitude) @ self._track
        f = -around.gravity * self._track[2]
        dt, none = part.dt[:, None], np.zeros_like(part.alpha)
        return replace(part, alpha=dt * w, upsilon=dt * f, coning=none, sculling=none)

    def _in_motion(self, part: Cycles, none: Correction, around: Surroundings) -> Cycles:
        """Cycles corrected along the motion as measured: near the true one."""
        sensors, rest = self._model.setup.sensors, np.zeros(len(part), dtype=bool)
        seen = motion(part, rest, none, self._track.copy(), around, predicted=False, before=self._before, causal=True)
        errors = sensors.errors(sensors.regressors(seen), self._reference)
        return corrected(part, seen, self._weight_along(seen), errors).cycles

    def _look_back(self) -> None:
        """Make passes over everything so far, about the present estimate, and go on from their end."""
        self._looked = self._epochs
        prepared = self._history.prepared()
        if prepared is None:
            return
        model, before = self._model, self.state
        begin = StartPoint(rotation_matrix(before.x[-COPY:].copy()) @ self._C_start, before.used)
        try:
            found = passes_so_far(model, prepared, self._alignment, begin, self._loose)
        except (DataError, np.linalg.LinAlgError):
            # What diverges now may be right with more stops; until then the filter goes on as it is.
            self._work += self._epochs
            return
        self._work += found.passes * self._epochs
        self._reference, self._C_start, self._deviation = found.reference, found.C_start, found.state
        self._loose, self._C_stop = found.loose, None
        self._force[:] = 0.0
        constant = slope_is_constant(model.setup.sensors, self._reference)
        assert self._before is not None
        first = slope_weight(self._before, model.setup.sensors, self._reference)
        self._weight = first[0] if constant else np.empty((0, 6, 6))
