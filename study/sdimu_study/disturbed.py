"""Tests on a bench that is not ideal: a site that is told wrong, a table that vibrates, stamps that jitter."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from sdimu_calibration.core import earth
from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.diagnosis.diagnose import Diagnosis
from sdimu_calibration.core.estimation.prepared_test import PreparedTest
from sdimu_calibration.core.recording import Recording
from sdimu_calibration.core.specification import Site
from sdimu_calibration.core.units import to_si
from sdimu_calibration.storage.files.config import load_imu, load_model
from sdimu_sim.core.truth import ImuTruth
from sdimu_study.score import scored
from sdimu_study.study import Group, Key, Study, largest_z, of, rms_cell
from sdimu_study.worlds import (
    OneTest,
    diagnosed,
    drawn_effect,
    drawn_place,
    in_the_mean,
    opened,
    place_told,
    rng_of,
    simulated_recording,
    simulated_test,
    with_effects,
)

_IMU = "dtg"
"""IMU file on every bench: its sigmas are small enough that a site and a table show."""
SITES = {"latitude .1 deg": (0.1, 0.0), "latitude .5 deg": (0.5, 0.0), "gravity 100 mgal": (0.0, 100.0)}
"""By how much the site that is told is wrong: deg, mgal. The site states that as its sigma."""
VIBRATIONS = {f"{size} arcsec, {hertz} Hz": (size, hertz) for size in (2.0, 1.0, 0.5) for hertz in (17.0, 31.0, 44.0)}
"""Amplitude (arcsec) and frequency (Hz) of a table that vibrates."""
JITTER = "stamps, 1.5 ms"
_JITTER_S, _JITTER_RATE_HZ = 1.5e-3, 50.0
"""Standard deviation of the stamps (s), and samples a second, of a host that stamps what it reads."""
_RATE_HZ = {**dict.fromkeys(VIBRATIONS, 100.0), JITTER: _JITTER_RATE_HZ}
_SLOW_HZ = 20.0
"""Samples a second of tests whose disturbance does not depend on them."""
_SPAN = (10.0, 30.0)
"""Size of an effect that is hidden beside a wrong site, in the sigma of the test with its site told right."""
BESIDE = ", an effect"
"""Ends the name of a case with one hidden effect."""
CASES: dict[Key, Key] = {(k,): (k,) for k in (*(s + b for s in SITES for b in ("", BESIDE)), *VIBRATIONS, JITTER)}
"""Every disturbance once."""


def world(case: Key, seed: int) -> OneTest:
    """Simulate a test with a disturbance."""
    (name,) = case
    kind, beside, _ = name.partition(BESIDE)
    rng, imu, rate_hz = rng_of(seed, "disturbed", name), load_imu(_IMU), _RATE_HZ.get(kind, _SLOW_HZ)
    plan, site = drawn_place(rng)
    told, axis, sign = site, rng.standard_normal(3), float(rng.choice((-1.0, 1.0)))
    if kind in SITES:
        told = told_wrong(site, *(sign * size for size in SITES[kind]))

    def undisturbed() -> tuple[PreparedTest, ImuTruth]:
        return simulated_test(_IMU, imu, plan, site, seed, (), (), rate_hz)

    def simulated(effects: tuple[str, ...]) -> tuple[PreparedTest, ImuTruth]:
        recording, sensor = simulated_recording(imu, plan, site, seed, effects, (), rate_hz)
        sensor = in_the_mean(sensor, recording, seed)
        if kind in VIBRATIONS:
            recording = shaken(recording, *VIBRATIONS[kind], axis / np.linalg.norm(axis))
        if kind == JITTER:
            recording = replace(recording, t=recording.t + _JITTER_S * rng.standard_normal(len(recording.t)))
        return opened(recording, imu, told), sensor

    draws = [lambda fit: drawn_effect(rng, fit, _SPAN)] if beside else []
    return with_effects(simulated, load_model("baseline"), draws, place_told(plan, site), undisturbed)


def told_wrong(site: Site, latitude_deg: float, gravity_mgal: float) -> Site:
    """Return a site as it is told: off in latitude or gravity, with the error as its sigma."""
    off, gravity = math.radians(latitude_deg), to_si(gravity_mgal, "mgal")
    if not gravity:
        return replace(site, latitude_rad=site.latitude_rad + off, latitude_sigma_rad=abs(off))
    normal = float(earth.normal_gravity(site.latitude_rad, site.height_m))
    return replace(site, gravity_m_s2=normal + gravity, gravity_sigma_m_s2=abs(gravity))


def shaken(recording: Recording, size_arcsec: float | Floats, hertz: float, axis: Floats) -> Recording:
    """Put a recording on a table that swings about an axis, to first order in the angle; rates and forces are means.

    Parameters
    ----------
    size_arcsec : float or ndarray, shape (n,)
        Amplitude (arcsec), one for all samples or of each.
    hertz : float
        Frequency (Hz).
    axis : ndarray, shape (3,)
        In b, of unit length (1).
    """
    t, dt, w = recording.t, recording.interval_s, 2.0 * math.pi * hertz
    a = to_si(1.0, "arcsec") * np.asarray(size_arcsec)
    rate = (a * (np.sin(w * t) - np.sin(w * (t - dt))) / dt)[:, None] * axis
    angle = (a * (np.cos(w * (t - dt)) - np.cos(w * t)) / (w * dt))[:, None] * axis
    return replace(
        recording,
        omega_ib_b=recording.omega_ib_b + rate - np.cross(angle, recording.omega_ib_b),
        f_ib_b=recording.f_ib_b - np.cross(angle, recording.f_ib_b),
    )


def score(world: OneTest, found: Diagnosis) -> dict[str, Any]:
    """Score what was named, and the errors over sigma of the coefficients."""
    return scored(world, found) | {"noise": list(found.noise)}


STUDY = Study(
    "disturbed",
    world,
    diagnosed,
    score,
    (
        ("disturbance", lambda g: g.key[0]),
        ("runs", lambda g: str(len(g.rows))),
        ("hidden effect named", lambda g: of(g.count(lambda r: r.get("in_class")), g.good) if _hidden(g) else ""),
        ("another effect named", lambda g: str(g.count(_other))),
        ("refused", lambda g: str(len(g.rows) - len(g.good))),
        ("RMS z", lambda g: rms_cell(g.good)),
        ("largest z", lambda g: largest_z(g.good)),
    ),
)


def _hidden(group: Group) -> bool:
    return group.key[0].endswith(BESIDE)


def _other(row: Any) -> bool:
    return len(row["named"]) > bool(row.get("in_class"))
