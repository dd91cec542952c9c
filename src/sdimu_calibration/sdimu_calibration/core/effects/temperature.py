"""Temperature: bias, scale factor and mass unbalance that follow it, bias and scale factor that follow its rate."""

from __future__ import annotations

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.effects.effect import ACCEL, GYRO, Effect, Excitation, per_axis_columns, pick
from sdimu_calibration.core.effects.mass_unbalance import GYRO_MASS_UNBALANCE, TERMS
from sdimu_calibration.core.effects.motion import Motion
from sdimu_calibration.core.effects.registry import register_family

_OVER_TIME = frozenset({Excitation.REPEATED_ATTITUDES})


def _change(motion: Motion) -> Floats:
    return motion.temperature[:, None].repeat(3, axis=1)


def _rate(motion: Motion) -> Floats:
    return motion.temperature_rate[:, None].repeat(3, axis=1)


def _triad(
    triad: tuple[int, ...],
    stem: str,
    word: str,
    unit: tuple[str, str],
    bias: tuple[float, float, float],
    rate: tuple[float, float, float],
    letter: str,
) -> tuple[Effect, Effect]:
    si, shown = unit
    alike = ("accel_triad_temperature",) if stem == "accel" else ()
    by_temperature = register_family(
        f"{stem}_bias_temperature",
        f"{word} bias temperature coefficient",
        f"d{letter}_i = k_i (T - T0)",
        per_axis_columns(triad, _change),
        (f"{si}/K", f"{shown}/degC"),
        bias,
        needs="temperature",
        excitation=_OVER_TIME,
        shifts_bias=True,
        sheet="bias temperature coefficient",
        typical=f"residual: {'0.002-0.1 deg/h/C' if stem == 'gyro' else '0.5-5 ug/C'}; raw 10-100 times more",
        description="Slow; stops that repeat an orientation at another temperature decide. T0 is the temperature at "
        "the start.",
        confused_with=(f"{stem}_bias_warm_up", f"{stem}_bias_ramp", f"{stem}_bias_random_walk", *alike),
    )
    by_rate = register_family(
        f"{stem}_bias_temperature_rate",
        f"{word} bias temperature-rate coefficient (Shupe)",
        f"d{letter}_i = k_i dT/dt",
        per_axis_columns(triad, _rate),
        (f"{si}*s/K", f"{shown}*min/degC"),
        rate,
        needs="temperature",
        excitation=_OVER_TIME,
        shifts_bias=True,
        sheet="bias temperature-rate coefficient",
        typical={"gyro": "FOG 0.05-1 deg/h/(C/min)", "accel": "1-20 ug/(C/min)"}[stem],
        description="Gradients inside the instrument: large while the temperature changes.",
        confused_with=(f"{stem}_bias_warm_up", f"{stem}_bias_step"),
    )
    return by_temperature, by_rate


GYRO_BIAS_TEMPERATURE, GYRO_BIAS_TEMPERATURE_RATE = _triad(
    GYRO, "gyro", "gyro", ("rad/s", "deg/h"), (0.02, 0.5, 10), (0.5, 2, 20), "w"
)
ACCEL_BIAS_TEMPERATURE, ACCEL_BIAS_TEMPERATURE_RATE = _triad(
    ACCEL, "accel", "accelerometer", ("m/s^2", "ug"), (5, 50, 500), (10, 50, 500), "f"
)

GYRO_SCALE_TEMPERATURE = register_family(
    "gyro_scale_temperature",
    "gyro scale-factor temperature coefficient",
    "dw_i = k_i (T - T0) w_i",
    per_axis_columns(GYRO, lambda m: _change(m) * m.w),
    ("1/K", "ppm/degC"),
    (20, 50, 100),
    needs="temperature",
    excitation=_OVER_TIME,
    sheet="scale-factor temperature coefficient",
    typical="DTG 5-20, FOG 5-50, tactical 20-100 ppm/C",
    description="Seen in turns about the same axis at different temperatures.",
    confused_with=("gyro_scale_ramp", "gyro_scale_temperature_rate"),
)

ACCEL_SCALE_TEMPERATURE = register_family(
    "accel_scale_temperature",
    "accelerometer scale-factor temperature coefficient",
    "df_i = k_i (T - T0) f_i",
    per_axis_columns(ACCEL, lambda m: _change(m) * m.f),
    ("1/K", "ppm/degC"),
    (5, 50, 200),
    needs="temperature",
    excitation=_OVER_TIME,
    sheet="scale-factor temperature coefficient",
    typical="residual 0.5-5, raw 100-180 ppm/C",
    description="Seen where an axis carries gravity at different temperatures.",
    confused_with=("accel_scale_ramp", "accel_scale_temperature_rate"),
)

GYRO_SCALE_TEMPERATURE_RATE = register_family(
    "gyro_scale_temperature_rate",
    "gyro scale-factor temperature-rate coefficient",
    "dw_i = k_i dT/dt w_i",
    per_axis_columns(GYRO, lambda m: _rate(m) * m.w),
    ("s/K", "ppm*min/degC"),
    (20, 100, 500),
    needs="temperature",
    excitation=_OVER_TIME,
    typical="FOG 10-100, DTG 5-50 ppm/(C/min)",
    description="Coil or torquer and its sensor of temperature warm up at different speeds.",
    confused_with=("gyro_scale_temperature", "gyro_scale_ramp"),
)

ACCEL_SCALE_TEMPERATURE_RATE = register_family(
    "accel_scale_temperature_rate",
    "accelerometer scale-factor temperature-rate coefficient",
    "df_i = k_i dT/dt f_i",
    per_axis_columns(ACCEL, lambda m: _rate(m) * m.f),
    ("s/K", "ppm*min/degC"),
    (20, 100, 500),
    needs="temperature",
    excitation=_OVER_TIME,
    typical="5-50 ppm/(C/min)",
    description="Magnet or electrodes and their sensor of temperature warm up at different speeds.",
    confused_with=("accel_scale_temperature", "accel_scale_ramp"),
)

_UNBALANCE = GYRO_MASS_UNBALANCE.regressors

MASS_UNBALANCE_TEMPERATURE = register_family(
    "gyro_mass_unbalance_temperature",
    "gyro mass-unbalance temperature coefficient",
    "dw = (T - T0) (m'_d a_own + m'_q a_cross)",
    {name: (GYRO[i // 2], pick(lambda m: m.temperature[:, None] * _UNBALANCE(m), i)) for i, name in enumerate(TERMS)},
    ("rad/s/g/K", "deg/h/g/degC"),
    (0.01, 0.05, 0.5),
    needs="temperature",
    excitation=_OVER_TIME,
    sheet="g-sensitivity temperature coefficient",
    typical="DTG 0.0005-0.005 deg/h/g/C",
    description="The rotor's centre of mass moves with the temperature of the suspension: seen where an axis "
    "carries gravity at different temperatures.",
    confused_with=("gyro_mass_unbalance_ramp", "gyro_bias_temperature"),
)
