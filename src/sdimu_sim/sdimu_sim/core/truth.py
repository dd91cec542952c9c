"""The true sensor: coefficients, the input axes they stand for, and the same sensor in another body frame."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from zlib import crc32

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.rotation import rotation_matrix
from sdimu_calibration.core.specification import ImuSpecification, Site

_XYZ = "xyz"
_PAIRS = ("xy", "xz", "yx", "yz", "zx", "zy")
UNBALANCE = {"dx": (0, 0), "qx": (0, 1), "dy": (1, 1), "qy": (1, 0), "dz": (2, 2), "qz": (2, 1)}
"""Place of each mass unbalance in the matrix that multiplies a = f/g."""

_GROUPS: dict[str, tuple[str, ...]] = {
    "gyro_bias": tuple(_XYZ),
    "gyro_scale": tuple(_XYZ),
    "gyro_misalignment": _PAIRS,
    "gyro_mass_unbalance": tuple(UNBALANCE),
    "accel_bias": tuple(_XYZ),
    "accel_scale": tuple(_XYZ),
    "accel_misalignment": _PAIRS,
}
_CUSTOMARY = {"bias": ("deg/h", "ug"), "scale": ("ppm", "ppm"), "misalignment": ("arcmin", "arcmin")}
COEFFICIENT_UNITS: dict[str, str] = {
    f"{group}_{part}": _CUSTOMARY.get(group.partition("_")[2], ("deg/h/g",) * 2)[group.startswith("accel")]
    for group, parts in _GROUPS.items()
    for part in parts
}
"""Customary unit of each coefficient."""
COEFFICIENTS: tuple[str, ...] = tuple(COEFFICIENT_UNITS)
"""The thirty coefficient names, in the order of the paper."""

DEFAULT_MAGNETIC_FIELD = (30.0e-6, -4.5e-6, 40.0e-6)
"""North, East, Down (T); the size and dip of mid-northern latitudes."""


@dataclass(frozen=True)
class ImuTruth:
    """Everything that makes the IMU's output differ from the world."""

    coefficients: Mapping[str, float] = field(default_factory=dict)
    """As built, SI, by fixed name; a name left out is zero. A misalignment is an angle by which an input axis was
    turned; a scale is a relative change of length of that axis."""
    mount_rad: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Rotation vector of the IMU on the platform: ``C_tb = rotation_matrix(mount)``."""
    gyro_white_noise: float = 0.0
    accel_white_noise: float = 0.0
    """`gyro_white_noise`, `accel_white_noise`: densities (rad/s/sqrt(Hz), m/s^2/sqrt(Hz))."""
    effects: tuple[str, ...] = ()
    """Hidden effects, canonical keys with sizes (`sdimu_sim.core.hidden`); those that name a coefficient or the lever
    arm are in `coefficients` and `lever_arm_m` already."""
    noise: tuple[str, ...] = ()
    """Noise with a memory, keys with sizes (`sdimu_sim.core.coloured`)."""
    lever_arm_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Of the accelerometers from the point that stands still, in b."""
    magnetic_field: tuple[float, float, float] = DEFAULT_MAGNETIC_FIELD
    """North, East, Down."""
    gyro_step_rad: float = 0.0
    accel_step_m_s: float = 0.0
    """`gyro_step_rad`, `accel_step_m_s`: quantum of the angle and velocity increments; 0 for none."""
    gyro_limit_rad_s: float = np.inf
    accel_limit_m_s2: float = np.inf
    """`gyro_limit_rad_s`, `accel_limit_m_s2`: output saturates at this size."""

    def __post_init__(self) -> None:
        """Refuse coefficient names that nothing would read."""
        unknown = sorted(set(self.coefficients) - set(COEFFICIENTS))
        if unknown:
            raise DataError(f"unknown coefficient '{unknown[0]}' (known: gyro_bias_x ... accel_misalignment_zy)")


@dataclass(frozen=True)
class Truth:
    """The truth of one recording: the IMU, and where and how it was tested."""

    imu: ImuTruth
    site: Site
    seed: int
    rate_hz: float
    plan: str
    mean_bias: Mapping[str, float] = field(default_factory=dict)
    """Biases in the mean over the dwells (SI), where they drift or wander."""
    reference_degc: float | None = None
    """Temperature T0 for which the coefficients are stated (deg C); None without a temperature."""


def child_rng(seed: int, name: str) -> np.random.Generator:
    """Make the random stream that belongs to a name, so that a new name never shifts the draws of another."""
    return np.random.default_rng(np.random.SeedSequence([seed, crc32(name.encode())]))


def draw_coefficients(imu: ImuSpecification, seed: int) -> dict[str, float]:
    """Draw the thirty coefficients from a specification: normal, zero mean, the prior as one sigma.

    A group without a prior is zero.
    """
    return {
        f"{group}_{part}": imu.prior.get(group, 0.0) * float(child_rng(seed, f"{group}_{part}").standard_normal())
        for group, parts in _GROUPS.items()
        for part in parts
    }


def turned_on(coefficients: Mapping[str, float], sigma: Mapping[str, float], seed: int) -> dict[str, float]:
    """Draw how coefficients of a unit differ in one power-on.

    `coefficients`: of the unit (SI); `sigma`: by group, such as ``gyro_bias``, how far each of its coefficients differs
    (SI).
    """
    out = dict(coefficients)
    for group, size in sigma.items():
        if group not in _GROUPS:
            raise DataError(f"turn-on of '{group}': expected one of {', '.join(_GROUPS)}")
        for part in _GROUPS[group]:
            name = f"{group}_{part}"
            out[name] = out.get(name, 0.0) + size * float(child_rng(seed, f"turn-on {name}").standard_normal())
    return out


def draw_mount(limit_rad: float, seed: int) -> tuple[float, float, float]:
    """Draw a mount rotation vector, uniform up to a limit about every axis (rad)."""
    x, y, z = child_rng(seed, "mount").uniform(-limit_rad, limit_rad, 3)
    return float(x), float(y), float(z)


def input_axes(triad: str, coefficients: Mapping[str, float]) -> Floats:
    """Input axes of a triad with their scale: output = result @ true vector + other errors.

    Each axis is the body axis really turned by its two angles (one rotation vector), times 1 + scale.

    `triad`: ``gyro`` or ``accel``; `coefficients`: as built. Gives a matrix, shape (3, 3): a row per sensor, in b.
    """
    rows = np.empty((3, 3))
    for i, own in enumerate(_XYZ):
        turn = np.zeros(3)
        for j, about in enumerate(_XYZ):
            if j != i:
                turn[j] = coefficients.get(f"{triad}_misalignment_{own}{about}", 0.0)
        rows[i] = (1.0 + coefficients.get(f"{triad}_scale_{own}", 0.0)) * rotation_matrix(turn)[:, i]
    return rows


def with_longer_axes(coefficients: Mapping[str, float], share: float) -> dict[str, float]:
    """Coefficients (as built) of the sensor whose accelerometer axes are `share` times as long."""
    longer = {f"accel_scale_{own}": (1.0 + coefficients.get(f"accel_scale_{own}", 0.0)) * share - 1.0 for own in _XYZ}
    return {**coefficients, **longer}


def unbalance_matrix(coefficients: Mapping[str, float]) -> Floats:
    """Mass unbalance as a matrix, shape (3, 3): gyro error = result @ (f / g) (rad/s per g)."""
    matrix = np.zeros((3, 3))
    for part, place in UNBALANCE.items():
        matrix[place] = coefficients.get(f"gyro_mass_unbalance_{part}", 0.0)
    return matrix


def biases(triad: str, coefficients: Mapping[str, float]) -> Floats:
    """Biases of a triad, shape (3,)."""
    return np.array([coefficients.get(f"{triad}_bias_{own}", 0.0) for own in _XYZ])


def in_body_frame(coefficients: Mapping[str, float], frame: str) -> dict[str, float]:
    """State the sensor by the coefficients of the error equations in a named body frame.

    The equations of doc/conventions.md are linear: a scale is the diagonal of the matrix of input axes less
    one, a misalignment an element beside it. So even in the frame in which the sensor was built they differ
    from the angles by second order. The frame ``accelerometer_triad`` is reached by the exact rotation R for
    which ``M_a R^T`` is lower triangular with positive diagonal; there q_xy = q_xz = q_yx = 0.

    Parameters
    ----------
    coefficients : mapping of str to float
        As built.
    frame : str
        ``prior`` (the frame in which it was built) or ``accelerometer_triad``.

    Returns
    -------
    dict of str to float
        The thirty coefficients, SI. Mass unbalance that the rotation moves outside the six terms (an
        arcminute of it) is left out.
    """
    if frame not in ("prior", "accelerometer_triad"):
        raise DataError(f"unknown body frame '{frame}' (expected accelerometer_triad or prior)")
    gyro, accel = input_axes("gyro", coefficients), input_axes("accel", coefficients)
    R = triad_rotation(accel) if frame == "accelerometer_triad" else np.eye(3)
    unbalance = unbalance_matrix(coefficients) @ R.T
    found = {name: float(coefficients.get(name, 0.0)) for name in COEFFICIENTS if "_bias_" in name}
    found |= elements("gyro", gyro @ R.T) | elements("accel", accel @ R.T)
    found |= unbalance_elements(unbalance)
    if frame == "accelerometer_triad":
        # Zero by the definition of the frame; the factorisation leaves 1e-19.
        found |= dict.fromkeys(("accel_misalignment_xy", "accel_misalignment_xz", "accel_misalignment_yx"), 0.0)
    return {name: found[name] for name in COEFFICIENTS}


def unbalance_elements(matrix: Floats) -> dict[str, float]:
    """Mass unbalance by name of its matrix (3, 3); what a turn moves outside the six terms is left out."""
    return {f"gyro_mass_unbalance_{part}": float(matrix[place]) for part, place in UNBALANCE.items()}


def triad_rotation(M: Floats) -> Floats:
    """R with ``M @ R.T`` lower triangular, positive diagonal: v_triad = R v_b."""
    Q, upper = np.linalg.qr(M.T)
    sign = np.sign(np.diag(upper))
    rotation: Floats = (Q * sign).T
    return rotation


def elements(triad: str, M: Floats) -> dict[str, float]:
    """Scale and misalignments of ``M = I + E`` in the signs of the error equations."""
    found = {f"{triad}_scale_{own}": float(M[i, i] - 1.0) for i, own in enumerate(_XYZ)}
    for pair in _PAIRS:
        i, j = _XYZ.index(pair[0]), _XYZ.index(pair[1])
        k = 3 - i - j
        # Turning axis i about axis j moves it along j x i = +-k.
        sign = 1.0 if (j + 1) % 3 == i else -1.0
        found[f"{triad}_misalignment_{pair}"] = sign * float(M[i, k])
    return found
