"""Suspension of an accelerometer's proof mass that remembers: viscoelastic relaxation, and play."""

from __future__ import annotations

from sdimu_calibration.core.effects.effect import ACCEL, Effect, family, per_axis_columns
from sdimu_calibration.core.effects.memory import low_pass, play
from sdimu_calibration.core.effects.registry import register
from sdimu_calibration.core.units import STANDARD_GRAVITY

_SCAN_TAU_S = (30.0, 120.0, 480.0)
"""Time constants tried (s): from a fifth of a dwell to several dwells; shorter ones settle, longer ones are a scale."""
_SCAN_BAND = (0.1, 0.3, 0.6)
"""Half-widths tried (g): a sweep from zero to 1 g crosses the first two whole and not the last."""


def relaxation(tau: float, ratio: float = 2.0) -> Effect:
    """Viscoelastic suspension with time constant `tau` (s), a factor `ratio` from the next ones that are tried.

    The standard linear solid: a spring beside a spring with a dashpot (Zener).
    """
    return family(
        "accel_relaxation",
        "accelerometer relaxation (viscoelastic suspension)",
        "df_i = k_i (a_i - y_i), tau dy_i/dt = a_i - y_i",
        per_axis_columns(ACCEL, lambda m: m.a - low_pass(m, tau)),
        ("m/s^2/g", "ug/g"),
        (20, 100, 1000),
        needs_table=True,
        wander_like=True,
        typical="navigation 1-20, MEMS 50-1000 ug/g with 10-1000 s",
        description="Stress in glue and flexures that gives way after each change of the force. In proportion to that "
        "change, as settling after each turn is not.",
        confused_with=("accel_bias_settling", "accel_creep", "accel_scale"),
        options={"tau": f"{tau:g} s"},
        with_options=relaxation,
        scan=lambda _times: tuple(relaxation(tau) for tau in _SCAN_TAU_S),
        nearer=(lambda: tuple(relaxation(float(f"{tau * ratio**k:.3g}"), ratio**0.5) for k in (-0.5, 0.0, 0.5)))
        if ratio > 1.1
        else None,
    )


def backlash(band: float) -> Effect:
    """Play of half-width `band` (g)."""
    return family(
        "accel_play",
        "accelerometer play (hysteresis with memory)",
        "df_i = h_i (a_i - y_i)/r, y_i: play of half-width r that follows a_i",
        per_axis_columns(ACCEL, lambda m: (m.a - play(m, band)) / band),
        ("m/s^2", "ug"),
        (20, 50, 500),
        needs_table=True,
        typical="navigation 5-50, MEMS 50-1000 ug",
        description="Dry friction in the suspension: the output lags by as much as the friction holds. A sweep of more "
        "than 2 r leaves h times the sense of the sweep, as hysteresis does; a smaller one leaves less.",
        confused_with=("accel_hysteresis", "accel_bias_asymmetry"),
        options={"r": f"{band:g} g"},
        with_options=lambda r: backlash(float(f"{r / STANDARD_GRAVITY:.6g}")),
        scan=lambda _times: tuple(backlash(band) for band in _SCAN_BAND),
    )


RELAXATION = register(relaxation(120.0))
PLAY = register(backlash(0.3))
