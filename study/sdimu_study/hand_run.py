"""One run of the study of runs by hand: any grade, rate and noise, rests that somebody nudges, with a hidden effect."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any
from zlib import crc32

import numpy as np

from sdimu_calibration.core import earth
from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.data.arrival import RawTest, in_order
from sdimu_calibration.core.diagnosis.diagnose import climb
from sdimu_calibration.core.estimation.prepared_test import PreparedTest
from sdimu_calibration.core.estimation.solve import solve
from sdimu_calibration.core.front_door import OpeningOptions, open_test
from sdimu_calibration.core.recording import PhaseLog
from sdimu_calibration.core.specification import ImuSpecification, Site
from sdimu_calibration.core.units import STANDARD_GRAVITY, from_si
from sdimu_calibration.storage.files.config import load_imu, load_model
from sdimu_sim.core.by_hand import ByHand, against_gravity, by_hand_motion, by_hand_recording
from sdimu_sim.core.truth import ImuTruth, child_rng
from sdimu_study.grade_run import LATITUDES_DEG, drawn_effect, scored_row
from sdimu_study.run import in_the_mean

IMUS = ("mems_by_hand", "mems_consumer", "mems_industrial", "fog_tactical")
"""IMU files that are drawn."""
_RATES_HZ = (50.0, 100.0, 200.0, 400.0)
"""Sample rates that are drawn (Hz)."""
_RESTS = (20, 37)
"""Least number of attitudes, and one more than the largest."""
_NUDGES = 0.3
"""Share of the rests that somebody nudges."""
_BURSTS, _PACKET, _LATE_S = 0.5, (8, 25), 0.004
"""Share of the runs whose samples arrive in packets; least size of a packet (samples) and one more than the largest;
mean delay of a packet (s)."""


@dataclass(frozen=True)
class HandRun:
    """Simulate a run by hand with bias instability of the data sheet, open it as any recording, diagnose it.

    Attributes
    ----------
    hidden : bool
        Hide one effect of 10 to 30 sigma.
    """

    hidden: bool

    def __call__(self, seed: int) -> dict[str, Any]:
        """Run a seed: verdict, errors over sigma of the coefficients, whether the effect was named.

        Raises
        ------
        DataError
            When the run cannot be calibrated.
        """
        rng = np.random.default_rng(np.random.SeedSequence([seed, crc32(b"by hand")]))
        name, rate, rests = str(rng.choice(IMUS)), float(rng.choice(_RATES_HZ)), int(rng.integers(*_RESTS))
        imu = load_imu(name)
        run = ByHand(
            rests, imu, Site(math.radians(float(rng.choice(LATITUDES_DEG))), 0.0), seed=seed, rate_hz=rate,
            noise=_stated_instability(imu), nudges=_NUDGES,
        )  # fmt: skip
        packet = int(rng.integers(*_PACKET)) if rng.random() < _BURSTS else 1
        model = load_model("hand")
        test, sensor = _opened(run, packet)
        fit, truth = solve(test, model), None
        if self.hidden:
            truth = drawn_effect(rng, fit)
            test, sensor = _opened(run.with_effects(truth.text), packet)
            fit = solve(test, model)
        found = climb(fit)
        # From here on the truth is known; nothing before this line has seen it.
        return scored_row(found, sensor, truth) | {
            "imu": name, "rate_hz": rate, "attitudes": rests, "rests": len(test.run.rests), "packet": packet,
        }  # fmt: skip


def _stated_instability(imu: ImuSpecification) -> tuple[str, ...]:
    """Bias instability of an IMU file, as the simulator takes it."""
    sizes = (("gyro", imu.gyro_bias_instability, "deg/h"), ("accel", imu.accel_bias_instability, "ug"))
    return tuple(f"{triad}_noise_flicker={from_si(size, unit):.6g} {unit}" for triad, size, unit in sizes if size)


def _opened(run: ByHand, packet: int) -> tuple[PreparedTest, ImuTruth]:
    """Open what arrives by a link that sends `packet` samples at once."""
    recording, truth = by_hand_recording(run)
    ns = recording.start_ns + np.rint(1e9 * _arrival(recording.t, packet, run.seed)).astype(np.int64)
    arrived = in_order(RawTest(ns, recording.omega_ib_b, recording.f_ib_b))
    opened = open_test(arrived, OpeningOptions(run.imu, run.site, "any"))
    true_gravity = float(earth.normal_gravity(run.site.latitude_rad, run.site.height_m))
    sensor = against_gravity(truth, STANDARD_GRAVITY, true_gravity).imu
    return PreparedTest(*opened), in_the_mean(sensor, replace(recording, phase=_true_phases(run)), run.seed)


def _arrival(t: Floats, packet: int, seed: int) -> Floats:
    """Moments at which samples arrive: those of a packet together, once its last one is there and the link free."""
    if packet == 1:
        return t
    last = t[np.minimum((np.arange(len(t)) // packet + 1) * packet, len(t)) - 1]
    late = child_rng(seed, "link").exponential(_LATE_S, -(-len(t) // packet))
    return np.asarray(np.maximum.accumulate(last + np.repeat(late, packet)[: len(t)]))


def _true_phases(run: ByHand) -> PhaseLog:
    """When the hand let go: over these times a bias that wanders is stated in the mean."""
    motion = by_hand_motion(run)
    still = np.asarray(~motion.omega_nt_t.any(axis=1), dtype=bool)
    begin = np.flatnonzero(still[:-1] & still[1:])
    return PhaseLog(
        np.stack([motion.t[begin], motion.t[begin + 1]], axis=1).ravel(),
        np.tile([True, False], len(begin)), np.repeat(np.arange(len(begin)), 2),
    )  # fmt: skip
