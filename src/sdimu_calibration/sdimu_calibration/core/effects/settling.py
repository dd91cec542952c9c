"""Bias that recovers after each turn: heat of the torquers, charge and stress that decay once the table stands."""

from __future__ import annotations

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.effects.effect import ACCEL, GYRO, Effect, family, per_axis_columns
from sdimu_calibration.core.effects.motion import Motion
from sdimu_calibration.core.effects.registry import register

_TRIADS = {
    "gyro": (GYRO, "gyro", "w", ("rad/s", "deg/h"), (0.05, 0.5, 10)),
    "accel": (ACCEL, "accelerometer", "f", ("m/s^2", "ug"), (10, 50, 500)),
}
_SCAN_TAU_S = (4.0, 8.0, 16.0, 32.0, 64.0, 128.0)
"""Time constants that a scan tries (s): with one longer than a dwell the effect is a step at every turn, with a shorter
one it is over before the first measurement."""


def settling(stem: str, tau: float, ratio: float = 2.0) -> Effect:
    """Transient of a bias after each turn with time constant `tau` (s), a factor `ratio` from the next ones tried."""
    triad, word, letter, units, prior = _TRIADS[stem]
    alike = ("accel_relaxation",) if stem == "accel" else ()

    def column(motion: Motion) -> Floats:
        # In the turn itself it is another effect: bias in motion.
        decay = np.where(motion.since_turn > 0.0, np.exp(-motion.since_turn / tau), 0.0)
        return decay[:, None].repeat(3, axis=1)

    return family(
        f"{stem}_bias_settling",
        f"{word} bias settling after each turn",
        f"d{letter}_i = k_i exp(-s/tau), s: time since the turn ended",
        per_axis_columns(triad, column),
        units,
        prior,
        wander_like=True,
        typical={"gyro": "0.01-0.1 deg/h with 5-100 s", "accel": "1-20 ug"}[stem],
        description="Torquers heated by the rate (DTG), charge and stress that decay once the table stands.",
        confused_with=(f"{stem}_bias_in_motion", f"{stem}_bias_step", f"{stem}_creep", *alike),
        options={"tau": f"{tau:g} s"},
        with_options=lambda tau: settling(stem, tau),
        scan=lambda _times: tuple(settling(stem, tau) for tau in _SCAN_TAU_S),
        nearer=(lambda: tuple(settling(stem, float(f"{tau * ratio**k:.3g}"), ratio**0.5) for k in (-0.5, 0.0, 0.5)))
        if ratio > 1.1
        else None,
    )


for _stem in _TRIADS:
    register(settling(_stem, 20.0))
