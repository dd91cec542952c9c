"""The classical calibration: multi-position and rate test by least squares, with the table's angles as reference.

What Kim, Song & Lyou argue against. The table angles are taken for the attitude of the IMU: its axes are those of the
table, the table stands level and north. The mean of the samples over every stop, and over every turn, less what a
perfect IMU would have given there, is linear in the coefficients. No navigation, no filter, no attitude to estimate.

A mount misalignment m then passes for a misalignment of every sensor, and for a scale error 1 - cos(m): the
coefficients are given in the body frame ``table``. They may be turned into the accelerometers' own frame afterwards,
which takes the mount out again, as far as the model holds what the turn mixes.

Source: Titterton & Weston, *Strapdown Inertial Navigation Technology*, 2nd ed., sections 8.3-8.5 (multi-position and
rate-table testing).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from sdimu_calibration.core import earth
from sdimu_calibration.core.alignment.prepared import PreparedData, TestSetup, set_up, weighed_for
from sdimu_calibration.core.alignment.rest_means import layout
from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.effects import body_frame
from sdimu_calibration.core.effects.motion import NO_PAST, Motion
from sdimu_calibration.core.estimation.prepared_test import PreparedTest
from sdimu_calibration.core.navigation.track import MAGNETIC_FIELD, temperatures
from sdimu_calibration.core.recording import DataError, Recording, TableLog
from sdimu_calibration.core.specification import ImuSpecification, Model, Site

GIMBALS = ("Y", "Z", "X")
"""IMU axes about which outer, middle and inner table axis turn when all angles are zero."""
TABLE_FRAME = "table"
"""Name of the axes of the table as a body frame."""


@dataclass(frozen=True)
class ClassicalResult:
    """Coefficients with the table's angles as reference."""

    model: tuple[str, ...]
    """Keys of the effects, as a `Calibration` has them."""
    names: tuple[str, ...]
    """Coefficients in the order of `values`, length p."""
    body_frame: str
    """Of the coefficients."""
    values: Floats
    covariance: Floats
    """`values`, `covariance`: SI, in `body_frame`, shapes (p,) and (p, p)."""
    chi2: float
    dof: int

    @property
    def nis(self) -> float:
        """Chi-square per degree of freedom: 1 where the angles of the table explain the samples."""
        return self.chi2 / max(self.dof, 1)

    def turned(self, frame: str) -> ClassicalResult:
        """Turn the coefficients from the axes of the table into another body frame, exactly."""
        J = body_frame.jacobian_at(self.names, self.values, frame)
        values = body_frame.values_in_frame(self.names, self.values, frame)
        return replace(self, body_frame=frame, values=values, covariance=J @ self.covariance @ J.T)


def calibrate_classically(recording: Recording, site: Site, imu: ImuSpecification, model: Model) -> ClassicalResult:
    """Calibrate an IMU against the angles of the table.

    Parameters
    ----------
    recording : Recording
        With the angles of outer, middle and inner axis.
    imu : ImuSpecification
        Its noise weighs the means; its priors are not used.
    """
    log, test = _gimbal_log(recording.table), PreparedTest(recording, imu, site)
    setup = set_up(site, imu, model, test.epoch_s(model.settle_s))
    prepared = test.data(setup)
    setup = weighed_for(setup, prepared)
    sensors, fitted = setup.sensors, _fit(prepared, setup, reference_motion(prepared, setup, log))
    return ClassicalResult(tuple(e.key for e in sensors.effects), sensors.names, TABLE_FRAME, *fitted)


def _gimbal_log(log: TableLog | None) -> TableLog:
    if log is None or not len(log.t):
        raise DataError("/rate_table/joint_states: missing; the classical calibration takes its references from them")
    if set(log.names) != {"outer", "middle", "inner"}:
        raise DataError(
            f"/rate_table/joint_states: axes {', '.join(log.names)}; the classical calibration needs outer, middle, "
            "inner"
        )
    return log


def table_attitude(log: TableLog, t: Floats) -> Floats:
    """Attitude of the platform: outer, then middle, then inner turn.

    Parameters
    ----------
    t : ndarray, shape (n,)
        Times (s).

    Returns
    -------
    ndarray, shape (n, 3, 3)
        Platform to table base (dimensionless).
    """
    C = np.broadcast_to(np.eye(3), (len(t), 3, 3))
    for name, letter in zip(("outer", "middle", "inner"), GIMBALS, strict=True):
        # An encoder may count from -180 to 180 deg: between two readings it did not turn back by almost a whole turn.
        angle = np.interp(t, log.t, np.unwrap(log.angle[:, log.names.index(name)]))
        C = C @ _about(letter, angle)
    return np.asarray(C)


def _about(letter: str, angle: Floats) -> Floats:
    """Rotation matrices (n, 3, 3) about an axis by angles (n,)."""
    i = "XYZ".index(letter)
    j, k = (i + 1) % 3, (i + 2) % 3
    C = np.zeros((len(angle), 3, 3))
    C[:, i, i] = 1.0
    C[:, j, j] = C[:, k, k] = np.cos(angle)
    C[:, j, k], C[:, k, j] = -np.sin(angle), np.sin(angle)
    return C


def reference_motion(prepared: PreparedData, setup: TestSetup, log: TableLog) -> Motion:
    """Make the motion that a perfect IMU along the table's axes would have seen."""
    c = prepared.cycles
    edges = np.append(c.t[0] - c.dt[0], c.t)
    C = table_attitude(log, edges)
    middle = 0.5 * (C[:-1] + C[1:])
    # Half of C' dC - its transpose is the sine of the small turn in a cycle.
    turn = np.transpose(C[:-1], (0, 2, 1)) @ C[1:]
    odd = 0.5 * (turn - np.transpose(turn, (0, 2, 1)))
    sine = np.column_stack([odd[:, 2, 1], odd[:, 0, 2], odd[:, 1, 0]])
    size = np.maximum(np.linalg.norm(sine, axis=1, keepdims=True), 1e-12)
    w_table = sine * (np.arcsin(np.minimum(size, 1.0)) / size) / c.dt[:, None]
    w = w_table + np.einsum("kij,i->kj", middle, earth.earth_rate(setup.site.latitude_rad))
    f = -setup.gravity * middle[:, 2, :]
    heat, heat_rate = temperatures(prepared.temperature, c.t - 0.5 * c.dt, causal=False)
    none = np.zeros_like(w)
    alpha = np.gradient(w_table, c.t - 0.5 * c.dt, axis=0)
    never = np.full(len(w), np.inf)
    return Motion(
        c.t,
        c.dt,
        w,
        f,
        middle,
        w_table,
        alpha,
        prepared.rest,
        heat,
        heat_rate,
        none,
        none,
        never,
        MAGNETIC_FIELD,
        none,
        NO_PAST,
    )


def _fit(prepared: PreparedData, setup: TestSetup, seen: Motion) -> tuple[Floats, Floats, float, int]:
    """Weighted least squares over the means of stops and turns: coefficients, covariance, chi-square, its degrees."""
    model, c = setup.sensors, prepared.cycles
    where = layout(prepared)
    inner = np.column_stack([where.stop_first, where.stop_last]).ravel()
    first, last = inner[:-1], inner[1:]
    sums = np.hstack(
        [
            c.dt[:, None],
            c.alpha - seen.w * c.dt[:, None],
            c.upsilon - seen.f * c.dt[:, None],
            model.regressors(seen) * c.dt[:, None],
        ]
    )
    total = np.vstack([np.zeros(sums.shape[1]), np.cumsum(sums, axis=0)])
    block = total[last] - total[first]
    seconds = block[:, 0]
    design = np.zeros((len(seconds), 6, len(model.prior)))
    for column, (channel, parameter) in enumerate(zip(model.channel, model.parameter, strict=True)):
        design[:, channel, parameter] += block[:, 7 + column] / seconds
    density = np.repeat([setup.imu.gyro_white_noise, setup.imu.accel_white_noise], 3)
    weight = np.sqrt(seconds)[:, None] / density
    rows = (weight[:, :, None] * design * model.prior).reshape(-1, len(model.prior))
    rhs = (weight * block[:, 1:7] / seconds[:, None]).ravel()
    R = np.linalg.qr(rows, mode="r")
    if np.min(np.abs(np.diag(R))) < 1e-6 * np.max(np.abs(np.diag(R))):
        name = model.names[int(np.argmin(np.abs(np.diag(R))))]
        raise DataError(f"this test does not show '{name}' to the classical calibration; leave its effect out")
    x = np.linalg.lstsq(rows, rhs, rcond=None)[0]
    inverse = np.linalg.inv(R)
    chi2 = float(np.sum((rows @ x - rhs) ** 2))
    scale = np.outer(model.prior, model.prior)
    return x * model.prior, (inverse @ inverse.T) * scale, chi2, len(rhs) - len(x)
