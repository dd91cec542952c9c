"""Runs by hand with rests that tremble: how much worse than with the rests known, and whether the sigmas hold."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.data.stated_rests import dwells_of
from sdimu_calibration.core.data.static_detection import detect_static
from sdimu_calibration.core.estimation.fit import Fit
from sdimu_calibration.core.estimation.prepared_test import PreparedTest
from sdimu_calibration.core.estimation.solve import solve
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.specification import Model
from sdimu_calibration.storage.files.config import load_imu, load_model
from sdimu_sim.core.by_hand import ByHand, by_hand_recording
from sdimu_sim.core.truth import COEFFICIENTS, ImuTruth, in_body_frame
from sdimu_study.hand import IMUS, stated_instability, true_phases
from sdimu_study.study import Group, Key, Rows, Study, of
from sdimu_study.worlds import drawn_site, felt, in_the_mean, opened, rng_of

RESTS, MOST_TREMBLING = 12, 6
"""Number of attitudes, and of those of them that tremble at most."""
_RATES_HZ = (50.0, 100.0, 200.0, 400.0)
"""Sample rates that are drawn (Hz)."""
_INSIDE_S = 0.1
"""What is left out at both ends of a rest that is known (s): the cut of a sample, and a motion that dies away."""
Spans = tuple[tuple[float, float], ...]


@dataclass(frozen=True)
class Trembling:
    """A run, and when it rested."""

    test: PreparedTest
    model: Model
    sensor: ImuTruth
    """Biases in the mean over the rests."""
    known: Spans
    """Begin and end of every rest (s)."""
    told: Mapping[str, Any]
    """What was drawn, for the row."""


def world(case: Key, seed: int) -> Trembling:
    """Simulate a run of an IMU file, `case`, with 0 to 6 rests that tremble by 2 to 6 times the noise."""
    rng = rng_of(seed, "trembling")
    (name,), rate = case, float(rng.choice(_RATES_HZ))
    trembling, imu = int(rng.integers(MOST_TREMBLING + 1)), load_imu(name)
    run = ByHand(
        RESTS, imu, drawn_site(rng), seed=seed, rate_hz=rate, noise=stated_instability(imu), trembling=trembling
    )
    recording, truth = by_hand_recording(run)
    phases = true_phases(replace(run, trembling=0))
    sensor = in_the_mean(felt(truth, run.site), replace(recording, phase=phases), run.seed)
    known = tuple((a + _INSIDE_S, b - _INSIDE_S) for a, b in dwells_of(phases, float(recording.t[-1])))
    told = {"imu": name, "rate_hz": rate, "trembling": trembling}
    return Trembling(opened(recording, imu, run.site, "any"), load_model("hand"), sensor, known, told)


def run(world: Trembling) -> dict[str, Fit]:
    """Fit with the rests found, with the quiet ones alone, and with all as they are known; without what is refused."""
    recording, out = world.test.recording, {}
    tests = {"found": world.test, "known": replace(world.test, rests=world.known, _prepared={})}
    with suppress(DataError):
        quiet = detect_static(recording)
        spans = tuple(
            (float(recording.t[a]), float(recording.t[b - 1])) for a, b in zip(quiet.first, quiet.last, strict=True)
        )
        tests["quiet"] = replace(world.test, rests=spans, _prepared={})
    for word, test in tests.items():
        with suppress(DataError):
            out[word] = solve(test, world.model, "handheld")
    return out


def score(world: Trembling, found: dict[str, Fit]) -> dict[str, Any]:
    """Sum of squares of the errors over the sigma with the rests known; of the rests found also over their own."""
    row: dict[str, Any] = dict(world.told)
    error, sigma = _errors(found["known"], world.sensor)
    row |= {"count": len(error), "known": float(np.sum((error / sigma) ** 2))}
    for word in ("found", "quiet"):
        if word in found:
            off, own = _errors(found[word], world.sensor)
            row |= {word: float(np.sum((off / sigma) ** 2)), f"{word}_z2": float(np.sum((off / own) ** 2))}
    row["rests"] = len(found["found"].rests()) if "found" in found else 0
    return row


def _errors(fit: Fit, sensor: ImuTruth) -> tuple[Floats, Floats]:
    """Errors of the coefficients that the frame leaves free, and their sigmas (SI), shape (k,) each."""
    truth = in_body_frame(sensor.coefficients, fit.body_frame)
    sigma = np.sqrt(np.abs(np.diag(fit.covariance)))
    rows = [i for i, name in enumerate(fit.names) if name in COEFFICIENTS and sigma[i] > 0.0]
    return np.array([fit.values[i] - truth[fit.names[i]] for i in rows]), sigma[rows]


def _ratio(rows: Rows, word: str) -> str:
    """RMS of the errors over that with the rests known."""
    used = [row for row in rows if word in row]
    return f"{np.sqrt(_sum(used, word) / _sum(used, 'known')):.2f}" if used else ""


def _rms_z(rows: Rows, word: str) -> str:
    used = [row for row in rows if word in row]
    return f"{np.sqrt(_sum(used, word) / _sum(used, 'count')):.2f}" if used else ""


def _sum(rows: Sequence[Mapping[str, Any]], word: str) -> float:
    return float(sum(row[word] for row in rows))


def _refused(group: Group, word: str) -> str:
    return of(sum(word not in row for row in group.rows), group.rows)


STUDY = Study(
    "trembling",
    world,
    run,
    score,
    (
        ("IMU file", lambda group: group.key[0]),
        ("refused", lambda group: _refused(group, "found")),
        ("error / with rests known", lambda group: _ratio(group.good, "found")),
        ("RMS z", lambda group: _rms_z(group.good, "found_z2")),
        ("quiet rests alone: refused", lambda group: _refused(group, "quiet")),
        ("error / with rests known", lambda group: _ratio(group.good, "quiet")),
        ("RMS z with rests known", lambda group: _rms_z(group.good, "known")),
    ),
)
CASES = {(name,): (name,) for name in IMUS}
"""One case an IMU file."""
