"""Mass unbalance of dynamically tuned gyroscopes: drift per unit of specific force.

Source: Kim, Song & Lyou, the sensor error model; direct (d) along the term named first, quadrature (q).
"""

from __future__ import annotations

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.effects.effect import BASELINE, GYRO, Effect, Parameter, Term
from sdimu_calibration.core.effects.motion import Motion
from sdimu_calibration.core.effects.registry import register
from sdimu_calibration.core.units import to_si

TERMS = ("dx", "qx", "dy", "qy", "dz", "qz")


def _regressors(motion: Motion) -> Floats:
    x, y, z = motion.a.T
    return np.column_stack([x, y, y, x, z, y])


GYRO_MASS_UNBALANCE = register(
    Effect(
        name="gyro_mass_unbalance",
        title="gyro mass unbalance (g-sensitive drift)",
        sheet="g-sensitivity",
        equation="dw_x = m_dx a_x + m_qx a_y; dw_y = m_dy a_y + m_qy a_x; dw_z = m_dz a_z + m_qz a_y; a = f/g",
        parameters=tuple(Parameter(f"gyro_mass_unbalance_{t}", "rad/s/g", "deg/h/g") for t in TERMS),
        terms=tuple(Term(GYRO[i // 2], i) for i in range(6)),
        regressors=_regressors,
        prior={"navigation": to_si(1, "deg/h/g"), "tactical": to_si(5, "deg/h/g"), "mems": to_si(50, "deg/h/g")},
        description="The centre of mass of the rotor is off the suspension: specific force across the spin axis makes "
        "a torque. Direct acts about the axis of the force, quadrature about the other.",
        typical="DTG 0.1-2, optical gyros none, MEMS 1-100 deg/h/g",
        group=BASELINE,
        linear=True,
        contained_in="gyro_g_sensitivity",
        confused_with=("gyro_bias",),
    )
)
