"""Misalignment of each input axis: "ij" is sensor axis i turned about body axis j.

An axis turned by small angles p about the body axes points along e + p x e, and senses its product with the
vector; the equations of Kim, Song & Lyou follow, x: e_x + (p_xz) e_y - (p_xy) e_z and in a circle.
"""

from __future__ import annotations

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.effects.effect import ACCEL, BASELINE, GYRO, Effect, Parameter, Term
from sdimu_calibration.core.effects.motion import Motion
from sdimu_calibration.core.effects.registry import register
from sdimu_calibration.core.units import to_si

PAIRS = ("xy", "xz", "yx", "yz", "zx", "zy")

_PRIOR = {"navigation": to_si(1, "arcmin"), "tactical": to_si(5, "arcmin"), "mems": to_si(2, "deg")}


def _regressors(v: Floats) -> Floats:
    """Columns in the order of `PAIRS` for a vector that the triad senses, (n, 3) -> (n, 6)."""
    x, y, z = v.T
    return np.column_stack([-z, y, z, -x, -y, x])


def _of_rate(motion: Motion) -> Floats:
    return _regressors(motion.w)


def _of_force(motion: Motion) -> Floats:
    return _regressors(motion.f)


def _terms(triad: tuple[int, ...]) -> tuple[Term, ...]:
    return tuple(Term(triad["xyz".index(pair[0])], i) for i, pair in enumerate(PAIRS))


GYRO_MISALIGNMENT = register(
    Effect(
        name="gyro_misalignment",
        title="gyro input-axis misalignment",
        sheet="input-axis misalignment",
        equation="dw_x = -p_xy w_z + p_xz w_y; dw_y = p_yx w_z - p_yz w_x; dw_z = -p_zx w_y + p_zy w_x",
        parameters=tuple(Parameter(f"gyro_misalignment_{p}", "rad", "arcmin") for p in PAIRS),
        terms=_terms(GYRO),
        regressors=_of_rate,
        prior=_PRIOR,
        description="The input axes do not lie along the body axes. Seen when the table turns.",
        typical="navigation 0.1-1, tactical 1-5, MEMS 10-120 arcmin",
        group=BASELINE,
        linear=True,
        gauge=True,
        confused_with=("accel_misalignment",),
    )
)

ACCEL_MISALIGNMENT = register(
    Effect(
        name="accel_misalignment",
        title="accelerometer input-axis misalignment",
        sheet="input-axis misalignment",
        equation="df_x = -q_xy f_z + q_xz f_y; df_y = q_yx f_z - q_yz f_x; df_z = -q_zx f_y + q_zy f_x",
        parameters=tuple(Parameter(f"accel_misalignment_{p}", "rad", "arcmin") for p in PAIRS),
        terms=_terms(ACCEL),
        regressors=_of_force,
        prior=_PRIOR,
        description="The input axes do not lie along the body axes. Three combinations turn the whole body frame "
        "together with the gyros' and are a matter of definition (doc/conventions.md).",
        typical="navigation 0.1-1, tactical 1-5, MEMS 10-120 arcmin",
        group=BASELINE,
        linear=True,
        gauge=True,
        confused_with=("gyro_misalignment",),
    )
)
