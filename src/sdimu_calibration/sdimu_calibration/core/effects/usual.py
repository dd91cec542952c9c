"""How usual the physics of each effect is: the odds that a model lacks it, before any data.

Relative to an effect that is known but stands in few data sheets, which has 1. Sources: data sheets and test standards
of inertial sensors list what is usual (IEEE Std 1293 for accelerometers: bias, scale, K2, K3, cross coupling,
asymmetry; IEEE Std 952 and 813 for gyros: asymmetry and nonlinearity of the scale factor, temperature, warm-up,
g-sensitivity; bandwidth and group delay of both). What a mount or a cable does, and what needs a strong field, is found
in few tests.
"""

from __future__ import annotations

_IN_DATA_SHEETS = 2.0
"""Odds (1) of physics that data sheets quote: makers test for it because it is there."""
_SELDOM = 0.5
"""Odds (1) of physics of a mount, a cable, a strong field: few tests find it."""
_NOISE = 0.05
"""Odds (1) of modes of a random walk: noise with a memory is a part of the model by itself, and these are the same."""

_USUAL = {
    **dict.fromkeys(
        (
            "accel_quadratic",
            "accel_scale_asymmetry",
            "accel_bias_temperature",
            "accel_scale_temperature",
            "accel_bias_warm_up",
            "accel_delay",
            "accel_size",
            "accel_triad_delay",
            "gyro_scale_asymmetry",
            "gyro_bias_temperature",
            "gyro_scale_temperature",
            "gyro_bias_warm_up",
            "gyro_delay",
            "gyro_g_sensitivity",
            "lever_arm",
        ),
        _IN_DATA_SHEETS,
    ),
    **dict.fromkeys(
        (
            "accel_bias_wrap",
            "accel_creep",
            "accel_magnetic",
            "accel_play",
            "accel_relaxation",
            "accel_triad_flexure",
            "gyro_bias_wrap",
            "gyro_creep",
            "gyro_dead_band",
            "gyro_lock_in",
            "gyro_magnetic",
        ),
        _SELDOM,
    ),
    "accel_bias_random_walk": _NOISE,
    "gyro_bias_random_walk": _NOISE,
}


def usual(family: str) -> float:
    """Odds of an effect, by its name in the registry, beside one that is known but stands in few data sheets (1)."""
    return _USUAL.get(family, 1.0)
