"""Runs by hand cut in parts of few rests, taken as a set: does one scatter of all keep the sigmas right."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np

from sdimu_calibration.core.joint.member import Job, Member, Report
from sdimu_calibration.core.joint.set_fit import SetOptions, fit_set
from sdimu_calibration.core.joint.set_result import set_outcome
from sdimu_calibration.core.note import MISFITS, topic_of
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.results import Calibration
from sdimu_calibration.core.specification import ImuSpecification
from sdimu_calibration.core.units import to_si
from sdimu_calibration.storage.files.config import load_imu, load_model
from sdimu_sim.core.by_hand import ByHand, by_hand_motion, by_hand_recording
from sdimu_sim.core.truth import COEFFICIENTS, ImuTruth, in_body_frame
from sdimu_study.set_world import here
from sdimu_study.static_world import Opened
from sdimu_study.study import Group, Key, Study, of
from sdimu_study.worlds import drawn_site, felt, opened, rng_of

_PARTS, _RESTS = (2, 4), (6, 10)
"""Least number of parts, and of rests in each, and one more than the largest."""
_SCATTER_UG = (50.0, 300.0)
"""Scatter of the forces from rest to rest (ug), in half of the runs."""


@dataclass(frozen=True)
class Parts:
    """Parts of a run as recordings of one power-on, and the sensor."""

    members: tuple[Member, ...]
    sensor: ImuTruth
    scatter_ug: float


def parts(run: ByHand, rests: Sequence[int], scatter: Sequence[float]) -> tuple[tuple[Member, ...], ImuTruth]:
    """Cut a run in parts of some rests each, the forces at each rest off by a scatter (m/s^2) of the part."""
    recording, truth = by_hand_recording(run)
    motion = by_hand_motion(run)
    still = ~np.any(motion.omega_nt_t, axis=1)
    rest = np.flatnonzero(still[:-1] & still[1:])
    between = 0.5 * (motion.t[rest + 1][:-1] + motion.t[rest][1:])
    part = np.repeat(np.arange(len(rests)), rests)
    rng = np.random.default_rng(run.seed)
    off = rng.standard_normal((len(rest), 3)) * np.asarray(scatter)[part, None]
    forces = recording.f_ib_b + off[np.searchsorted(between, recording.t)]
    cuts = [0.0, *between[np.flatnonzero(np.diff(part))].tolist(), np.inf]
    members = []
    for number, (begin, end) in enumerate(pairwise(cuts)):
        rows = (recording.t > begin) & (recording.t <= end)
        own = replace(
            recording,
            start_ns=recording.start_ns + round(begin * 1e9),
            t=recording.t[rows] - begin,
            omega_ib_b=recording.omega_ib_b[rows],
            f_ib_b=forces[rows],
        )
        members.append(Member(f"part {number}", Opened(opened(own, run.imu, run.site, "any")), power_on="one"))
    return tuple(members), felt(truth, run.site)


def world(case: Key, seed: int) -> Parts:
    """Draw a run of an IMU file, `case`, in two or three parts of 6 to 9 rests."""
    rng = rng_of(seed, "parts", *case)
    imu: ImuSpecification = load_imu(case[0])
    rests = rng.integers(*_RESTS, size=int(rng.integers(*_PARTS))).tolist()
    scatter = float(rng.uniform(*_SCATTER_UG)) if rng.random() < 0.5 else 0.0
    run = ByHand(sum(rests), imu, drawn_site(rng), seed=seed)
    return Parts(*parts(run, rests, [to_si(scatter, "ug")] * len(rests)), scatter)


def run(world: Parts) -> dict[str, Calibration]:
    """Fit the parts in the scatter that they share, and each in its own."""
    options = SetOptions(load_model("hand"))
    return {word: set_outcome(fit_set(world.members, options, do)) for word, do in (("shared", here), ("own", _own))}


def _own(jobs: Sequence[Job]) -> Sequence[Report | DataError]:
    """Do jobs, each recording in the scatter that it learns by itself."""
    return here([replace(job, scatter=None) for job in jobs])


def score(world: Parts, found: Mapping[str, Calibration]) -> dict[str, Any]:
    """Sum of the squares of error over sigma and the largest, and whether something is said not to fit, both ways."""
    row: dict[str, Any] = {"scatter_ug": world.scatter_ug, "parts": len(world.members)}
    for word, result in found.items():
        truth = in_body_frame(world.sensor.coefficients, result.body_frame)
        sigma = np.sqrt(np.abs(np.diag(result.covariance)))
        free = [k for k, name in enumerate(result.names) if name in COEFFICIENTS and sigma[k] > 0.0]
        z = np.array([(result.values[k] - truth[result.names[k]]) / sigma[k] for k in free])
        row[word] = {
            "z2": float(np.sum(z**2)),
            "count": len(z),
            "largest_z": float(np.abs(z).max()),
            "misfit": any(topic_of(line) in MISFITS for line in result.warnings),
        }
    return row


def _rms_z(word: str, group: Group) -> str:
    rows = [row[word] for row in group.good]
    return f"{np.sqrt(sum(row['z2'] for row in rows) / sum(row['count'] for row in rows)):.2f}" if rows else ""


def _largest(word: str, group: Group) -> str:
    return f"{max((row[word]['largest_z'] for row in group.good), default=float('nan')):.1f}"


def _misfits(word: str, group: Group) -> str:
    return of(group.count(lambda row: row[word]["misfit"]), group.good)


STUDY = Study(
    "parts",
    world,
    run,
    score,
    (
        ("IMU file", lambda group: group.key[0]),
        ("failed", lambda group: of(len(group.rows) - len(group.good), group.rows)),
        ("RMS z", partial(_rms_z, "shared")),
        ("largest z", partial(_largest, "shared")),
        ("said not to fit", partial(_misfits, "shared")),
        ("each in its own scatter: RMS z", partial(_rms_z, "own")),
        ("largest z", partial(_largest, "own")),
        ("said not to fit", partial(_misfits, "own")),
    ),
)
CASES = {(name,): (name,) for name in ("mems_by_hand", "mems_consumer", "mems_industrial")}
"""One case an IMU file."""
