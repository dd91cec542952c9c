"""Creep after a turn, with the sense of the turn: wound-up leads, stress that decays once the table stands."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.effects.effect import ACCEL, GYRO, Effect, family, per_axis_columns
from sdimu_calibration.core.effects.motion import Motion
from sdimu_calibration.core.effects.registry import register

_SCAN_TAU_S = (8.0, 32.0, 128.0)
"""Time constants tried (s): longer ones than a dwell are hysteresis, shorter ones are over before the first second."""


def _turned(motion: Motion) -> Floats:
    return motion.turned


def _leant(motion: Motion) -> Floats:
    return motion.leant


_TRIADS: dict[str, tuple[tuple[int, ...], str, str, Callable[[Motion], Floats], tuple[str, str]]] = {
    "gyro": (GYRO, "gyro", "dw_i = k_i sgn(last turn about i) exp(-s/tau)", _turned, ("rad/s", "deg/h")),
    "accel": (ACCEL, "accelerometer", "df_i = k_i sgn(last change of a_i) exp(-s/tau)", _leant, ("m/s^2", "ug")),
}
_PRIOR = {"gyro": (0.05, 0.5, 10), "accel": (10, 50, 500)}


def creep(stem: str, tau: float, ratio: float = 2.0) -> Effect:
    """Creep with time constant `tau` (s), a factor `ratio` from the next ones that are tried."""
    triad, word, equation, sense, units = _TRIADS[stem]
    alike = ("accel_relaxation",) if stem == "accel" else ()

    def column(motion: Motion) -> Floats:
        decay = np.where(motion.since_turn > 0.0, np.exp(-motion.since_turn / tau), 0.0)
        return np.asarray(decay[:, None] * sense(motion))

    return family(
        f"{stem}_creep",
        f"{word} creep after a turn",
        f"{equation}, s: time since the turn ended",
        per_axis_columns(triad, column),
        units,
        _PRIOR[stem],
        needs_table=True,
        wander_like=True,
        typical={"gyro": "0.01-0.1 deg/h with 5-200 s", "accel": "1-20 ug"}[stem],
        description="Wind-up of leads and suspension that decays after the turn. Turns of the other sense change its "
        "sign; without them it is settling.",
        confused_with=(f"{stem}_bias_settling", f"{stem}_hysteresis", *alike),
        options={"tau": f"{tau:g} s"},
        with_options=lambda tau: creep(stem, tau),
        scan=lambda _times: tuple(creep(stem, tau) for tau in _SCAN_TAU_S),
        nearer=(lambda: tuple(creep(stem, float(f"{tau * ratio**k:.3g}"), ratio**0.5) for k in (-0.5, 0.0, 0.5)))
        if ratio > 1.1
        else None,
    )


for _stem in _TRIADS:
    register(creep(_stem, 30.0))
