"""Change with time: warm-up, ramp, step, random walk of bias; ramps of scale factor and mass unbalance."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.effects.effect import (
    ACCEL,
    AXES,
    GYRO,
    Column,
    Effect,
    Excitation,
    Timetable,
    family,
    per_axis_columns,
    pick,
)
from sdimu_calibration.core.effects.mass_unbalance import GYRO_MASS_UNBALANCE, TERMS
from sdimu_calibration.core.effects.motion import Motion
from sdimu_calibration.core.effects.registry import register

_TRIADS = {
    "gyro": (GYRO, "gyro", "w", ("rad/s", "deg/h"), (0.5, 3, 50)),
    "accel": (ACCEL, "accelerometer", "f", ("m/s^2", "ug"), (50, 200, 2000)),
}
_SCAN_TAU_S = (150.0, 300.0, 600.0, 1200.0, 2400.0)
"""Time constants of warm-up that a scan tries (s): those of usual gyros, 300 to 1800 s, and beyond on both sides; a
factor of two apart, as `Effect.nearer` finds those in between."""
_MODES = 4
"""Number of modes of a random walk: four hold 95 % of its variance."""
_OVER_TIME = frozenset({Excitation.REPEATED_ATTITUDES})


def _columns(values: Floats) -> Floats:
    return np.broadcast_to(values[:, None], (len(values), 3))


def _time(motion: Motion) -> Floats:
    """Mid-cycle time since the start (s)."""
    return motion.t - 0.5 * motion.dt


def warm_up(stem: str, tau: float, ratio: float = 2.0) -> Effect:
    """Warm-up transient of a bias with time constant `tau` (s), a factor `ratio` from the next ones that are tried."""
    triad, word, letter, units, prior = _TRIADS[stem]
    return family(
        f"{stem}_bias_warm_up",
        f"{word} warm-up transient",
        f"d{letter}_i = k_i exp(-t/tau)",
        per_axis_columns(triad, lambda m: _columns(np.exp(-_time(m) / tau))),
        units,
        prior,
        scope="power-on",
        excitation=_OVER_TIME,
        bias_drift=True,
        typical={"gyro": "0.05-1 deg/h with 300-1800 s", "accel": "5-50 ug"}[stem],
        description="Turn-on transient. Early stops against later ones in the same orientation.",
        confused_with=(f"{stem}_bias_temperature", f"{stem}_bias_ramp", f"{stem}_bias_random_walk"),
        options={"tau": f"{tau:g} s"},
        with_options=lambda tau: warm_up(stem, tau),
        scan=lambda _times: tuple(warm_up(stem, tau) for tau in _SCAN_TAU_S),
        nearer=(lambda: tuple(warm_up(stem, float(f"{tau * ratio**k:.3g}"), ratio**0.5) for k in (-0.5, 0.0, 0.5)))
        if ratio > 1.1
        else None,
    )


def _times(factor: float, prior: tuple[float, float, float]) -> tuple[float, float, float]:
    return factor * prior[0], factor * prior[1], factor * prior[2]


def step(stem: str, t0: float, spacing: float = 60.0) -> Effect:
    """Step of a bias at `t0` (s), `spacing` (s) from the next moments that are tried."""
    triad, word, letter, units, prior = _TRIADS[stem]
    return family(
        f"{stem}_bias_step",
        f"{word} bias step",
        f"d{letter}_i = k_i (t > t0)",
        per_axis_columns(triad, lambda m: _columns(np.clip((m.t - t0) / m.dt, 0.0, 1.0))),
        units,
        _times(0.3, prior),
        scope="power-on",
        excitation=_OVER_TIME,
        bias_drift=True,
        typical="any size; after a shock, a power dip, a turn",
        description="Bias that changes at one moment. Scanned over the starts and ends of the turns.",
        confused_with=(f"{stem}_bias_ramp", f"{stem}_bias_temperature_rate", f"{stem}_bias_wrap"),
        options={"t0": f"{t0:g} s"},
        with_options=lambda t0: step(stem, t0),
        scan=lambda times: tuple(step(stem, round(start)) for _, start, _ in (*times.stops[1:], *times.turns[1:])),
        nearer=(lambda: tuple(step(stem, round(t0 + side * spacing, 1), 0.5 * spacing) for side in (-0.5, 0.0, 0.5)))
        if spacing > 2.0
        else None,
    )


def random_walk(stem: str, span: float) -> Effect:
    """Random walk of a bias over `span` (s) by its first Karhunen-Loeve modes.

    Mode k of Brownian motion on [0, T] is ``sin((k - 1/2) pi t / T)`` with variance in proportion to
    ``1 / ((k - 1/2) pi)^2``; four hold 95 % of the variance (Loeve, *Probability Theory II*).
    """
    triad, word, letter, units, prior = _TRIADS[stem]

    def mode(k: int) -> Column:
        scale = 1.0 / ((k - 0.5) * np.pi)
        return lambda m: scale * np.sin((k - 0.5) * np.pi * np.minimum(_time(m) / span, 1.0))

    columns = {f"{a}{k}": (triad[i], mode(k)) for i, a in enumerate(AXES) for k in range(1, _MODES + 1)}
    return family(
        f"{stem}_bias_random_walk",
        f"{word} bias random walk (rate random walk)",
        f"d{letter}_i = sum_k c_ik sin((k - 1/2) pi t/T) / ((k - 1/2) pi), k = 1..4",
        columns,
        units,
        prior,
        scope="power-on",
        excitation=_OVER_TIME,
        bias_drift=True,
        typical="see the Allan deviation",
        description="Slow wander, by its first four Karhunen-Loeve modes over the test.",
        confused_with=(f"{stem}_bias_ramp", f"{stem}_bias_warm_up", f"{stem}_bias_temperature", f"{stem}_bias_wrap"),
        options={"span": f"{span:g} s"},
        with_options=lambda span: random_walk(stem, span),
        scan=lambda times: (random_walk(stem, round(times.duration)),),
    )


def _ramp(stem: str) -> Effect:
    triad, word, letter, (si, shown), prior = _TRIADS[stem]
    return family(
        f"{stem}_bias_ramp",
        f"{word} bias ramp",
        f"d{letter}_i = k_i t",
        per_axis_columns(triad, lambda m: _columns(_time(m))),
        (f"{si}/s", f"{shown}/h"),
        _times(0.4, prior),
        scope="power-on",
        excitation=_OVER_TIME,
        bias_drift=True,
        # Data sheets of gyros state none: the prior stands for it.
        typical="1-20 ug/h" if stem == "accel" else "",
        description="Bias that runs away at a constant rate.",
        confused_with=(
            f"{stem}_bias_warm_up",
            f"{stem}_bias_temperature",
            f"{stem}_bias_random_walk",
            f"{stem}_bias_wrap",
            "accel_triad_ramp",
        ),
    )


def _scale_ramp(stem: str, per_hour: tuple[float, float, float]) -> Effect:
    triad, word, letter, _, _ = _TRIADS[stem]

    def signal(motion: Motion) -> Floats:
        return _columns(_time(motion)) * (motion.w if stem == "gyro" else motion.f)

    return family(
        f"{stem}_scale_ramp",
        f"{word} scale-factor ramp",
        f"d{letter}_i = k_i t {letter}_i",
        per_axis_columns(triad, signal),
        ("1/s", "ppm/h"),
        per_hour,
        scope="power-on",
        excitation=_OVER_TIME,
        typical="as the temperature coefficient times the warm-up",
        description="Scale factor that runs away at a constant rate.",
        confused_with=(f"{stem}_scale_temperature", f"{stem}_scale_temperature_rate"),
    )


for _stem in _TRIADS:
    register(_ramp(_stem))
    register(warm_up(_stem, 1200.0))
    register(step(_stem, 600.0))
    register(random_walk(_stem, 3600.0))
register(_scale_ramp("gyro", (50, 200, 1000)))
register(_scale_ramp("accel", (10, 100, 1000)))

_UNBALANCE = GYRO_MASS_UNBALANCE.regressors

MASS_UNBALANCE_RAMP = register(
    replace(
        family(
            "gyro_mass_unbalance_ramp",
            "gyro mass-unbalance drift",
            "dw = t (m'_d a_own + m'_q a_cross)",
            {
                name: (GYRO[i // 2], pick(lambda m: _columns(_time(m))[:, :1] * _UNBALANCE(m), i))
                for i, name in enumerate(TERMS)
            },
            ("rad/s/g/s", "deg/h/g/h"),
            (0.1, 0.5, 5),
        ),
        scope="power-on",
        excitation=_OVER_TIME,
        typical="DTG 0.005-0.05 deg/h/g/h",
        description="The rotor's centre of mass moves with the temperature of the suspension.",
        confused_with=("gyro_bias_ramp", "gyro_mass_unbalance_temperature"),
    )
)

__all__ = ["MASS_UNBALANCE_RAMP", "Timetable", "random_walk", "step", "warm_up"]
