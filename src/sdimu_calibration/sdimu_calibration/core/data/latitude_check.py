"""The place as the data see it: the Earth's rate along the vertical gives the latitude, the force its gravity.

At rest a gyro triad with bias b shows omega = b + C_bn omega_ie, and the accelerometers the upward direction u in the
same axes. So u . omega = u . b + Omega sin(latitude): one line a stop in four unknowns, whatever the attitudes, which
must not all lie on one cone. No azimuth is needed, and scale errors of some per cent do not matter.

Source: Groves, *Principles of GNSS, Inertial, and Multisensor Integrated Navigation Systems*, 2nd ed., section 2.4.1.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sdimu_calibration.core import earth
from sdimu_calibration.core.arrays import Floats, Ints
from sdimu_calibration.core.data.windows import Windows, cut_windows
from sdimu_calibration.core.effects.bias import ACCEL_BIAS
from sdimu_calibration.core.effects.mass_unbalance import GYRO_MASS_UNBALANCE
from sdimu_calibration.core.effects.scale import ACCEL_SCALE
from sdimu_calibration.core.probability import normal_tail, student_limit
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.specification import ImuSpecification, Site
from sdimu_calibration.core.units import STANDARD_GRAVITY
from sdimu_calibration.core.wording import Option

_FEWEST_STOPS = 6
"""Least number of stops: four unknowns, and two more for the misfit."""
_SEEN = 0.15
"""Largest sigma of an observed vertical Earth rate, a share of the Earth rate: 9 deg of latitude at the equator."""
_SIGMAS = 4.0
"""Ratio of a difference to its sigma from which a site contradicts the data: one false alarm in 16,000. That of few
rests, whose scatter is not well known, has the same probability by Student's t."""


@dataclass(frozen=True)
class EarthRate:
    """What the rests say of the place."""

    up_rate: float
    up_sigma: float
    """`up_rate`, `up_sigma`: Earth's rate along the measured upward force, and its one sigma (rad/s); NaN and inf when
    it is not seen."""
    gravity: float
    gravity_sigma: float
    """`gravity`, `gravity_sigma`: median of |f| at rest and what bias and scale factor may do to it (m/s^2)."""
    stops: int
    """Rests that were used."""
    up_dof: float
    """Degrees of freedom of `up_sigma` (1): a scatter of few rests is not well known."""

    @property
    def seen(self) -> bool:
        """Whether the Earth's rate stands out."""
        return self.up_sigma < _SEEN * earth.RATE

    @property
    def latitude(self) -> tuple[float, float]:
        """Latitude and its one sigma (rad), when the force points up."""
        sine = float(np.clip(self.up_rate / earth.RATE, -1.0, 1.0))
        # Near the poles the sine says little: never claim more than its sigma allows at its far end.
        cosine = float(np.sqrt(max(1.0 - sine**2, 2.0 * self.up_sigma / earth.RATE)))
        return float(np.arcsin(sine)), self.up_sigma / earth.RATE / cosine

    def excludes(self, site: Site, sign: float = 1.0) -> bool:
        """Whether the data were not taken at the latitude of a site, the force times `sign` pointing up."""
        expected = earth.RATE * float(np.sin(site.latitude_rad))
        limit = student_limit(normal_tail(_SIGMAS), self.up_dof) * self.up_sigma
        told = _SIGMAS * earth.RATE * float(np.cos(site.latitude_rad)) * site.astronomic_latitude_sigma_rad
        return self.seen and abs(sign * self.up_rate - expected) > float(np.hypot(limit, told))


def observe_earth_rate(t: Floats, omega_ib_b: Floats, f_ib_b: Floats, imu: ImuSpecification) -> EarthRate | None:
    """Look for the Earth's rate and gravity in the rests.

    Parameters
    ----------
    t : ndarray, shape (n,)
        Seconds, ascending.
    omega_ib_b, f_ib_b : ndarray, shape (n, 3)
        rad/s, m/s^2.
    imu : ImuSpecification
        Its priors say what else than the Earth may be in the numbers.

    Returns
    -------
    EarthRate or None
        None when there are no rests.
    """
    windows = cut_windows(t, omega_ib_b, f_ib_b)
    rests = _rests(windows)
    if not rests:
        return None
    mean = np.array([[*windows.w_mean[r].mean(axis=0), *windows.f_mean[r].mean(axis=0)] for r in rests])
    prior = imu.prior
    force = np.linalg.norm(mean[:, 3:], axis=1)
    gravity_sigma = np.hypot(prior.get(ACCEL_BIAS.name, 0.0), STANDARD_GRAVITY * prior.get(ACCEL_SCALE.name, 0.0))
    unbalance = prior.get(GYRO_MASS_UNBALANCE.name, 0.0)
    up_rate, up_sigma, up_dof = _vertical_rate(mean[:, :3], mean[:, 3:] / force[:, None], unbalance)
    return EarthRate(up_rate, up_sigma, float(np.median(force)), float(gravity_sigma), len(rests), up_dof)


def contradictions(seen: EarthRate, site: Site) -> tuple[str, ...]:
    """Say in what a stated place is not where the data were taken, one line each."""
    lines = []
    if seen.excludes(site):
        what = f"check {Option.SITE}{or_sign(seen, site)}"
        lines.append(f"{latitude_in_data(seen)}, the site is at {_latitude(site)}: {what}")
    gravity = site.gravity_m_s2 or float(earth.normal_gravity(site.latitude_rad, site.height_m))
    if abs(seen.gravity - gravity) > _SIGMAS * float(np.hypot(seen.gravity_sigma, site.gravity_sigma_m_s2)):
        lines.append(
            f"|f| at rest is {seen.gravity:.4f} m/s^2, gravity at the site {gravity:.4f}: they differ by more than the "
            f"IMU's specification allows; check {Option.SITE} (latitude, height) and {Option.IMU}"
        )
    return tuple(lines)


def reversed_force(seen: EarthRate, site: Site) -> bool:
    """Whether the Earth turns the other way about the measured force: its negative was recorded.

    Decided only where the latitude that was stated fits then, and does not as it stands.
    """
    return seen.excludes(site) and not seen.excludes(site, -1.0)


def assumption(name: str, site: Site, seen: EarthRate | None, where: str) -> str:
    """Say that a site was assumed, and which latitude the data show.

    Parameters
    ----------
    where : str
        File or topic, for errors.
    """
    if seen is not None and seen.excludes(site):
        raise DataError(
            f"{where}: {latitude_in_data(seen)}; no site was stated, and the assumed one ({name}) is at "
            f"{_latitude(site)}: state yours{_or_turned(seen, site)}. {Option.SITE} takes a name in config/site or a "
            "YAML file with the lines 'format: sdimu-site/1', 'latitude_deg: ...' and 'height_m: ...' (Python: "
            "open(..., site=...); node: parameter site)"
        )
    text = f"no {Option.SITE}: {name} is assumed (latitude {_latitude(site)}, height {site.height_m:.0f} m)"
    if seen is None or not seen.seen:
        return f"{text}; the data do not show the Earth's rate well enough to say the latitude"
    return f"{text}; {latitude_in_data(seen)}"


def latitude_in_data(seen: EarthRate) -> str:
    """Say the latitude that the rests show."""
    latitude, sigma = np.degrees(seen.latitude)
    digits = int(np.clip(np.ceil(-np.log10(max(sigma, 1e-4))), 1, 4))
    return f"the Earth's rate in the data is that of latitude {latitude:.{digits}f} +- {sigma:.{digits}f} deg"


def _or_turned(seen: EarthRate, site: Site) -> str:
    """Say at which place the force would have the other sign, where the assumed site would fit then; else nothing.

    Nobody stated that site, and the rests alone do not tell a place in the other hemisphere from a turned force.
    """
    if not reversed_force(seen, site):
        return ""
    latitude, sigma = np.degrees(seen.latitude)
    return (
        f" (only if it lies at latitude {-latitude:.0f} +- {sigma:.0f} deg is the sign of the force turned: then "
        f"{Option.ACCEL_SIGN} -1, or 1 where -1 was stated)"
    )


def or_sign(seen: EarthRate, site: Site) -> str:
    """Advise to turn the sign of the force where that would fit a site that was stated; else nothing."""
    told = f", or the sign of the force ({Option.ACCEL_SIGN} -1 would fit, or 1 where -1 was stated)"
    return told if reversed_force(seen, site) else ""


def _latitude(site: Site) -> str:
    return f"{round(float(np.degrees(site.latitude_rad)), 4):g} deg"


def _rests(windows: Windows) -> list[Ints]:
    """Windows of each rest: three or more in a row, without the first and the last, where motion may begin or end."""
    still = windows.still
    joined = np.concatenate([[True], np.diff(windows.first) > windows.length])[: len(still)]
    number = np.cumsum(joined | np.concatenate([[True], np.diff(still.astype(np.int64)) != 0])[: len(still)])
    runs = [np.flatnonzero(still & (number == k)) for k in np.unique(number[still])]
    return [run[1:-1] for run in runs if len(run) > 2]


def _vertical_rate(w: Floats, up: Floats, unbalance: float) -> tuple[float, float, float]:
    """Least squares of u . omega = u . b + c: c, its sigma and degrees of freedom; NaN and inf where stops cannot tell.

    Mass unbalance along the input axes adds the mean of three of its coefficients to c: it is no noise, and its prior
    is known. The degrees of freedom of the sum are those of Welch and Satterthwaite.
    """
    untold = float("nan"), float("inf"), 1.0
    if len(w) < _FEWEST_STOPS:
        return untold
    design = np.column_stack([up, np.ones(len(up))])
    y = np.sum(w * up, axis=1)
    if np.linalg.matrix_rank(design, tol=1e-2) < 4:
        return untold
    x, *_ = np.linalg.lstsq(design, y, rcond=None)
    dof = len(y) - 4
    scatter = float(np.sum((y - design @ x) ** 2)) / dof * float(np.linalg.inv(design.T @ design)[3, 3])
    variance = scatter + unbalance**2 / 3.0
    return float(x[3]), float(np.sqrt(variance)), dof * (variance / max(scatter, 1e-6 * variance)) ** 2
