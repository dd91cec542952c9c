"""Time: sensors that lag behind each other, data lost in a turn."""

from __future__ import annotations

import numpy as np

from sdimu_calibration.core.effects.effect import ACCEL, AXES, GYRO, Effect, Parameter, Term, family, per_axis_columns
from sdimu_calibration.core.effects.registry import register
from sdimu_calibration.core.motion import Floats, Motion
from sdimu_calibration.core.units import STANDARD_GRAVITY

GYRO_DELAY = register(
    family(
        "gyro_delay", "gyro delay against the other sensors", "dw_i = -tau_i dw_i/dt",
        per_axis_columns(GYRO, lambda m: -m.alpha), ("s", "ms"), (1, 2, 5),
        typical="0.01-5 ms",
        description="Transport delay or bandwidth. A delay common to all six sensors cannot be seen.",
        confused_with=("accel_delay", "gyro_acceleration_sensitivity"),
    )
)  # fmt: skip

ACCEL_DELAY = register(
    family(
        "accel_delay", "accelerometer delay against the gyros (time skew)", "df_i = -tau_i df_i/dt = tau_i (w x f)_i",
        per_axis_columns(ACCEL, lambda m: -STANDARD_GRAVITY * m.a_rate), ("s", "ms"), (1, 2, 5),
        typical="0.01-5 ms; 1 ms makes 14 mm/s in a 90 deg turn",
        description="The force that an accelerometer reports is older than the attitude of the gyros.",
        confused_with=("gyro_delay",),
    )
)  # fmt: skip


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


def lost_data(start: float, end: float, turn: int) -> Effect:
    """Gyro data lost somewhere in a turn that lasts from `start` to `end` (s)."""

    def missing(motion: Motion) -> Floats:
        share = (motion.t > start) & (motion.t - motion.dt < end)
        return np.asarray(-motion.w_table * (share / max(end - start, 1e-3))[:, None])

    return Effect(
        name="gyro_lost_data",
        title="gyro data lost in a turn",
        equation="dw = -w over a time that is missing in one turn",
        parameters=(Parameter("gyro_lost_data", "s", "ms"),),
        terms=tuple(Term(channel, 0) for channel in GYRO),
        regressors=missing,
        prior={"navigation": 0.02, "tactical": 0.02, "mems": 0.02},
        typical="one or a few samples; 10 ms at 2 deg/s are 72 arcsec",
        description="Samples dropped before the stamps were given: the angle of one turn is too small. A fault of "
        "the recording, "
        "not of the sensor.",
        run_local=True,
        options={"turn": str(turn), "start": f"{start:g} s", "end": f"{end:g} s"},
        with_options=lambda turn, start, end: lost_data(start, end, int(turn)),
        scan=lambda times: tuple(lost_data(t0, t1, stop + 1) for stop, t0, t1 in times.turns),
    )


GYRO_LOST_DATA = register(lost_data(100.0, 145.0, 1))

__all__ = ["AXES", "GYRO_LOST_DATA"]
