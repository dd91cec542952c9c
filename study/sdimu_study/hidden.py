"""Hidden effects drawn at random: simulate, diagnose blindly, score what was found by name."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from sdimu_calibration.core.diagnosis.diagnose import Diagnosis, diagnose
from sdimu_calibration.core.diagnosis.scan import Scan, scan
from sdimu_calibration.core.recording import Recording
from sdimu_calibration.core.results import Calibration
from sdimu_calibration.core.specification import ImuSpecification, Model, Site
from sdimu_calibration.storage.files.config import load_plan
from sdimu_sim.core.scenario import Scenario, imu_truth
from sdimu_sim.core.truth import ImuTruth, child_rng
from sdimu_study.hidden_draw import RATE_HZ, WARM_UP, Draw, Sizes, draw
from sdimu_study.hidden_outside import OUTSIDE, shapes
from sdimu_study.score import baseline_z, classes, same_effect
from sdimu_study.study import Study
from sdimu_study.worlds import Truth, hideable_names, in_the_mean, simulate

WRONG_DENSITY = 1.3
"""Noise of the sensor over its specification, where that is the fault."""
_OUTLIER_SIGMAS = 20.0


@dataclass(frozen=True)
class HiddenCase:
    """A kind of `hidden_draw.KINDS`, the model that is to be found wanting, how small an effect a plan can see."""

    kind: str
    imu: ImuSpecification
    model: Model
    tables: tuple[Sizes, ...]


@dataclass(frozen=True)
class Hidden:
    """A recording of what was drawn; the sensor's biases are those in the mean over the dwells."""

    drawn: Draw
    recording: Recording
    site: Site
    imu: ImuSpecification
    model: Model
    sensor: ImuTruth


def world(case: HiddenCase, seed: int) -> Hidden:
    """Draw a test and simulate it."""
    drawn = draw(case.kind, seed, case.tables, hideable_names())
    scenario = scenario_of(drawn, case.imu, seed)
    sensor = imu_truth(scenario)
    recording = with_fault(simulate(scenario, sensor), drawn, case.imu, seed)
    return Hidden(drawn, recording, scenario.site, case.imu, case.model, in_the_mean(sensor, recording, seed))


def run(world: Hidden) -> Diagnosis:
    """Diagnose the recording with nothing but IMU file and site."""
    return diagnose(world.recording, world.site, world.imu, world.model)


def scenario_of(drawn: Draw, imu: ImuSpecification, seed: int) -> Scenario:
    """Scenario of a draw; wrong densities are put into the sensor, not into the specification it is judged by."""
    true = imu
    if drawn.fault.startswith("gyro noise"):
        true = replace(imu, gyro_white_noise=WRONG_DENSITY * imu.gyro_white_noise)
    elif drawn.fault.startswith("accel noise"):
        true = replace(imu, accel_white_noise=WRONG_DENSITY * imu.accel_white_noise)
    return Scenario(
        plan=load_plan(drawn.plan),
        imu=true,
        site=Site(math.radians(drawn.latitude_deg), 0.0),
        rate_hz=RATE_HZ,
        seed=seed,
        effects=tuple(t.text for t in drawn.truths),
        temperature=WARM_UP,
    )


def with_fault(recording: Recording, drawn: Draw, imu: ImuSpecification, seed: int) -> Recording:
    """Add outliers of 20 sample sigmas, either sign, to a share of the samples, where that is the fault."""
    if not drawn.fault.startswith("outliers"):
        return recording
    share = float(drawn.fault.split()[1]) / 100.0
    rng = child_rng(seed, "outliers")
    hit = rng.random(len(recording.t)) < share
    sign = rng.choice((-1.0, 1.0), size=(len(recording.t), 6)) * hit[:, None]
    size = _OUTLIER_SIGMAS / np.sqrt(recording.interval_s)
    return replace(
        recording,
        omega_ib_b=recording.omega_ib_b + sign[:, :3] * size * imu.gyro_white_noise,
        f_ib_b=recording.f_ib_b + sign[:, 3:] * size * imu.accel_white_noise,
    )


def score(world: Hidden, found: Diagnosis) -> dict[str, Any]:
    """Row of a run.

    Returns
    -------
    dict
        ``kind``, ``plan``, ``latitude_deg``, ``fault``, ``truths`` (see `_judge`), ``verdict``, ``sentence``,
        ``named`` (labels of what was found), ``classes`` (labels of each class), ``families``, ``noise``, ``data``
        (kinds of what was found in the samples), ``own``,
        ``steps``, ``rms_z_before`` and ``_after`` (baseline coefficients), ``held_out_before`` and ``_after``,
        ``stops_before`` and ``_after`` (leave one stop out), ``remainder_p``, ``scan_z2`` and ``scan_count``
        (catalogue), ``threshold``.
    """
    drawn, sensor = world.drawn, world.sensor
    scanned = scan(found.evidence.information, found.evidence.model, found.evidence.weight)
    named = classes(found)
    accepted = found.found.steps
    catalogue = [k for k in range(len(found.evidence.weight), int(found.free[0])) if np.isfinite(scanned.sigma[k])]
    return {
        "kind": drawn.kind,
        "plan": drawn.plan,
        "latitude_deg": drawn.latitude_deg,
        "fault": drawn.fault,
        "truths": [_judge(t, found, scanned, named) for t in drawn.truths],
        "verdict": found.verdict,
        "sentence": found.sentence,
        "named": [c.label for c in found.chosen],
        "families": [c.family for c in found.chosen],
        "classes": named,
        "noise": list(found.noise),
        "data": [f.kind for f in found.findings],
        "own": found.own,
        "unexplained": found.unexplained,
        "steps": [
            {
                "label": s.label,
                "z": s.z,
                "log_bayes": s.log_bayes_factor,
                "gain": s.held_out_gain,
                "error": s.held_out_error,
            }
            for s in found.found.steps
        ],
        "rms_z_before": _rms_z(found.before, sensor),
        "rms_z_after": _rms_z(found.after, sensor),
        "held_out_before": found.before.fit["held_out_rms"],
        "held_out_after": found.after.fit["held_out_rms"],
        "stops_before": accepted[0].held_out_before.rms if accepted else None,
        "stops_after": accepted[-1].held_out_after.rms if accepted else None,
        "remainder_p": found.free_inputs_after.p_value,
        "remainder_p_before": found.free_inputs_before.p_value,
        "scan_z2": float(np.sum(scanned.z[catalogue] ** 2)),
        "scan_count": len(catalogue),
        "threshold": found.found.threshold,
        "explained": found.explained,
    }


def _rms_z(calibration: Calibration, sensor: ImuTruth) -> float:
    return float(np.sqrt(np.mean(baseline_z(calibration, sensor) ** 2)))


def _judge(truth: Truth, found: Diagnosis, scanned: Scan, named: list[list[str]]) -> dict[str, Any]:
    """Say how one hidden effect was found.

    ``realised``: size in the sigma of this very test; ``in_class``, ``best``: named in a class, named first;
    ``share``: of its signature, beyond the model's coefficients, that what was found takes; ``error_sigmas``: error of
    its amplitude in the refit (of the scan, when another of its class was named), None with a scanned option.
    """
    stops = found.evidence.times.stops
    row: dict[str, Any] = {
        "name": truth.name,
        "family": truth.family,
        "option": truth.option,
        "value": truth.value,
        "sigmas": truth.sigmas,
        "text": truth.text,
        "in_class": any(same_effect(x, truth, stops) for c in named for x in c) or _seen_in_samples(truth, found),
        "best": any(same_effect(c.label, truth, stops) for c in found.chosen),
        "share": None,
        "realised": None,
        "z": None,
        "error_sigmas": None,
    }
    if truth.family == OUTSIDE:
        before, after = (max(left, 0.0) for left in _signature_left(truth, found))
        return row | {"share": 1.0 - after / before if before else None, "realised": abs(truth.value) * before**0.5}
    near = [k for k, x in enumerate(found.evidence.names) if same_effect(x, truth, stops)]
    if not near:
        return row
    k = max(near, key=lambda i: abs(scanned.z[i]))
    row |= {"realised": abs(truth.value) / scanned.sigma[k], "z": scanned.z[k]}
    if truth.option is None or (truth.option[0] == "turn" and not _seen_in_samples(truth, found)):
        row["error_sigmas"] = _amplitude_error(truth, found, scanned, k)
    return row


def _seen_in_samples(truth: Truth, found: Diagnosis) -> bool:
    """Whether data lost in a turn were found earlier: the screen took the sample away, as what it is, in that turn."""
    if truth.option is None or truth.option[0] != "turn":
        return False
    turns = [(a, b) for stop, a, b in found.evidence.times.turns if stop + 1 == truth.option[1]]
    return any(f.kind == "spike" and a <= f.start_s and f.end_s <= b for f in found.findings for a, b in turns)


def _amplitude_error(truth: Truth, found: Diagnosis, scanned: Scan, k: int) -> float:
    after = found.after
    if truth.name in after.names and truth.name not in found.before.names:
        i = after.names.index(truth.name)
        return float((after.values[i] - truth.value) / np.sqrt(after.covariance[i, i]))
    return float((scanned.estimate[k] - truth.value) / scanned.sigma[k])


def _signature_left(truth: Truth, found: Diagnosis) -> tuple[float, float]:
    """Information on a shape outside the catalogue, given the model, and given also what was found."""
    evidence = found.evidence
    shape = next((s for s in shapes(evidence.times) if s.label == truth.name), None)
    if shape is None:
        return 0.0, 0.0
    w = evidence.signature([shape.effect()])[:, 0]
    none = np.empty(0, dtype=np.int64)
    left = []
    for chosen in (none, found.found.chosen):
        known = np.concatenate([evidence.model, chosen])
        A = evidence.information.J[np.ix_(known, known)] + np.diag([*evidence.weight, *(0.0 for _ in chosen)])
        s = 1.0 / np.sqrt(np.diag(A))
        b = s * (evidence.W[:, known].T @ w)
        left.append(float(w @ w - b @ np.linalg.solve(A * np.outer(s, s), b)))
    return left[0], left[1]


STUDY = Study("hidden", world, run, score)
