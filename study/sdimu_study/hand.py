"""Runs by hand: any grade, rate and noise, rests that somebody nudges, clean or with a hidden effect."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.data.arrival import RawTest, in_order
from sdimu_calibration.core.diagnosis.diagnose import Diagnosis, climb
from sdimu_calibration.core.estimation.prepared_test import PreparedTest
from sdimu_calibration.core.estimation.solve import solve
from sdimu_calibration.core.recording import PhaseLog
from sdimu_calibration.core.specification import ImuSpecification
from sdimu_calibration.core.units import from_si
from sdimu_calibration.storage.files.config import load_imu, load_model
from sdimu_sim.core.by_hand import ByHand, by_hand_motion, by_hand_recording
from sdimu_sim.core.truth import ImuTruth, child_rng
from sdimu_study.score import scored
from sdimu_study.study import Key, Results, Study, Table, good, rms_z
from sdimu_study.worlds import OneTest, drawn_effect, drawn_site, felt, in_the_mean, opened, rng_of, with_effects

CLEAN, HIDDEN = "clean", "hidden"
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


def world(case: Key, seed: int) -> OneTest:
    """Simulate a run by hand with bias instability of the data sheet, `CLEAN` or with an effect of 10 to 30 sigma."""
    rng = rng_of(seed, "by hand")
    name, rate, rests = str(rng.choice(IMUS)), float(rng.choice(_RATES_HZ)), int(rng.integers(*_RESTS))
    imu = load_imu(name)
    run = ByHand(rests, imu, drawn_site(rng), seed=seed, rate_hz=rate, noise=stated_instability(imu), nudges=_NUDGES)
    packet = int(rng.integers(*_PACKET)) if rng.random() < _BURSTS else 1
    return with_effects(
        lambda effects: _opened(run.with_effects(*effects) if effects else run, packet),
        load_model("hand"),
        [lambda fit: drawn_effect(rng, fit)] if case == (HIDDEN,) else [],
        {"imu": name, "rate_hz": rate, "attitudes": rests, "packet": packet},
    )


def run(world: OneTest) -> tuple[Diagnosis, int]:
    """Diagnose, and count the rests that were found."""
    found = climb(solve(world.test, world.model))
    return found, len(world.test.run.rests)


def score(world: OneTest, outcome: tuple[Diagnosis, int]) -> dict[str, Any]:
    """Verdict, errors over sigma of the coefficients, whether the effect was named."""
    return scored(world, outcome[0]) | {"rests": outcome[1]}


def stated_instability(imu: ImuSpecification) -> tuple[str, ...]:
    """Bias instability of an IMU file, as the simulator takes it."""
    sizes = (("gyro", imu.gyro_bias_instability, "deg/h"), ("accel", imu.accel_bias_instability, "ug"))
    return tuple(f"{triad}_noise_flicker={from_si(size, unit):.6g} {unit}" for triad, size, unit in sizes if size)


def _opened(run: ByHand, packet: int) -> tuple[PreparedTest, ImuTruth]:
    """Open what arrives by a link that sends `packet` samples at once."""
    recording, truth = by_hand_recording(run)
    ns = recording.start_ns + np.rint(1e9 * _arrival(recording.t, packet, run.seed)).astype(np.int64)
    arrived = in_order(RawTest(ns, recording.omega_ib_b, recording.f_ib_b))
    test = opened(arrived, run.imu, run.site, "any")
    return test, in_the_mean(felt(truth, run.site), replace(recording, phase=true_phases(run)), run.seed)


def _arrival(t: Floats, packet: int, seed: int) -> Floats:
    """Moments at which samples arrive: those of a packet together, once its last one is there and the link free."""
    if packet == 1:
        return t
    last = t[np.minimum((np.arange(len(t)) // packet + 1) * packet, len(t)) - 1]
    late = child_rng(seed, "link").exponential(_LATE_S, -(-len(t) // packet))
    return np.asarray(np.maximum.accumulate(last + np.repeat(late, packet)[: len(t)]))


def true_phases(run: ByHand) -> PhaseLog:
    """When the hand let go: over these times a bias that wanders is stated in the mean."""
    motion = by_hand_motion(run)
    still = np.asarray(~motion.omega_nt_t.any(axis=1), dtype=bool)
    begin = np.flatnonzero(still[:-1] & still[1:])
    times = np.stack([motion.t[begin], motion.t[begin + 1]], axis=1).ravel()
    return PhaseLog(times, np.tile([True, False], len(begin)), np.repeat(np.arange(len(begin)), 2))


STUDY = Study("hand", world, run, score)
_HEADINGS = ("IMU file", "clean runs", "consistent", "RMS z", "hidden runs", "in a class", "first", "RMS z")


def table(results: Results) -> Table:
    """Sum results by `CLEAN` and `HIDDEN` up, one line an IMU file."""
    return Table(_HEADINGS, [[name, *_cells(results, name)] for name in (*IMUS, "all")])


def _cells(results: Results, name: str) -> Sequence[str]:
    cells: list[str] = []
    for key, found in results.items():
        rows = [r for r in good(found) if name in (r["imu"], "all")]
        said = ("in_class", "first") if key == (HIDDEN,) else ("consistent",)
        hits = [sum(bool(r.get(s, r["verdict"] == s)) for r in rows) for s in said]
        cells += [str(len(rows)), *map(str, hits), f"{rms_z(rows):.2f}"]
    return cells


def refused(results: Results) -> list[str]:
    """Say what runs were refused for."""
    return [row["error"] for rows in results.values() for row in rows if "error" in row]
