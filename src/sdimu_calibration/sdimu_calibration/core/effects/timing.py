"""Time: sensors that lag behind each other, data lost in a turn."""

from __future__ import annotations

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.effects.effect import ACCEL, AXES, GYRO, Effect, Parameter, Term, per_axis_columns
from sdimu_calibration.core.effects.motion import Motion
from sdimu_calibration.core.effects.registry import register, register_family
from sdimu_calibration.core.units import STANDARD_GRAVITY

GYRO_DELAY = register_family(
    "gyro_delay",
    "gyro delay against the other sensors",
    "dw_i = -tau_i dw_i/dt",
    per_axis_columns(GYRO, lambda m: -m.alpha),
    ("s", "ms"),
    (1, 2, 5),
    needs_table=True,
    typical="0.01-5 ms",
    description="Transport delay or bandwidth. A delay common to all six sensors cannot be seen.",
    confused_with=("accel_delay", "gyro_acceleration_sensitivity"),
)

ACCEL_DELAY = register_family(
    "accel_delay",
    "accelerometer delay against the gyros (time skew)",
    "df_i = -tau_i df_i/dt = tau_i (w x f)_i",
    per_axis_columns(ACCEL, lambda m: -STANDARD_GRAVITY * m.a_rate),
    ("s", "ms"),
    (1, 2, 5),
    needs_table=True,
    typical="0.01-5 ms; 1 ms makes 14 mm/s in a 90 deg turn",
    description="The force that an accelerometer reports is older than the attitude of the gyros.",
    confused_with=("gyro_delay",),
)


def _skew(motion: Motion) -> Floats:
    return np.asarray(-STANDARD_GRAVITY * motion.a_rate)


ACCEL_TRIAD_DELAY = register(
    Effect(
        name="accel_triad_delay",
        title="delay of the accelerometer triad against the gyro triad (time skew)",
        equation="df = -tau df/dt = tau w x f",
        parameters=(Parameter("accel_triad_delay", "s", "ms"),),
        terms=tuple(Term(channel, 0) for channel in ACCEL),
        regressors=_skew,
        prior={"navigation": 1e-3, "tactical": 2e-3, "mems": 5e-3},
        typical="0.01-5 ms",
        description="All three accelerometers lag behind the gyros alike: another sampling clock or filter.",
        confused_with=("accel_delay", "gyro_delay"),
    )
)


def lost_data(turn: int, at: float, spacing: float = 15.0) -> Effect:
    """Gyro data lost in a turn.

    An angle lost early in a turn bends the specific force for longer than one lost late, so the velocity after the turn
    tells the moment.

    Parameters
    ----------
    turn : int
        Number of the turn: it leads from stop ``turn - 1`` to stop ``turn``.
    at : float
        Moment of the loss, since the start of the recording (s).
    spacing : float
        Distance to the next moments that are tried (s).
    """

    def missing(motion: Motion) -> Floats:
        overlap = np.minimum(motion.t, at + 0.5 * _LOSS_S) - np.maximum(motion.t - motion.dt, at - 0.5 * _LOSS_S)
        share = np.maximum(overlap, 0.0) / motion.dt
        return np.asarray(-_full_rate(motion, at) * (share / _LOSS_S)[:, None])

    def nearer() -> tuple[Effect, ...]:
        return tuple(lost_data(turn, round(at + side * 0.5 * spacing, 1), 0.5 * spacing) for side in (-1.0, 0.0, 1.0))

    return Effect(
        name="gyro_lost_data",
        title="gyro data lost in a turn",
        equation="dw = -w of the full rate, over a time that is missing in one turn",
        parameters=(Parameter("gyro_lost_data", "s", "ms"),),
        positive=True,
        terms=tuple(Term(channel, 0) for channel in GYRO),
        regressors=missing,
        prior={"navigation": 0.02, "tactical": 0.02, "mems": 0.02},
        typical="one or a few samples; 10 ms at 2 deg/s are 72 arcsec",
        description="Samples dropped before the stamps were given: the angle of one turn is too small. A fault of the "
        "recording, not of the sensor.",
        scope="recording",
        needs_table=True,
        options={"turn": str(turn), "at": f"{at:g} s"},
        with_options=lambda turn, at: lost_data(int(turn), at),
        scan=lambda times: tuple(lost_data(stop + 1, at) for stop, t0, t1 in times.turns for at in _moments(t0, t1)),
        nearer=nearer if spacing > 0.3 else None,
    )


_LOSS_S = 0.2
"""Length of the stretch over which a loss is spread (s): two cycles of navigation, the step of all regressors."""


def _full_rate(motion: Motion, at: float) -> Floats:
    """Full rate of the turn at a moment (s), shape (3,); nought when the table stands then.

    The median of what is faster than half: a loss that is being mended lifts the cycles about it.
    """
    rate, still = motion.table_rate, motion.standing
    here = min(int(np.searchsorted(motion.t, at)), len(rate) - 1)
    place = int(np.searchsorted(still, here))
    first = int(still[place - 1]) + 1 if place else 0
    last = int(still[place]) if place < len(still) else len(rate)
    if first >= last:
        return np.zeros(3)
    turn = slice(first, last)
    return np.asarray(np.median(motion.w_table[turn][rate[turn] > 0.5 * rate[turn].max()], axis=0))


def _moments(start: float, end: float) -> list[float]:
    """Moments of a turn, evenly spread and at most 15 s apart."""
    count = int(np.ceil((end - start) / 15.0))
    return [round(start + (k + 0.5) * (end - start) / count, 1) for k in range(count)]


GYRO_LOST_DATA = register(lost_data(1, 120.0))

__all__ = ["AXES", "GYRO_LOST_DATA"]
