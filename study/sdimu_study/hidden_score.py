"""Score a finished diagnosis against what was hidden, by name."""

from __future__ import annotations

from typing import Any

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.diagnosis.diagnose import Diagnosis
from sdimu_calibration.core.diagnosis.found import found_effects
from sdimu_calibration.core.diagnosis.scan import Scan, scan
from sdimu_calibration.core.effects import body_frame
from sdimu_calibration.core.results import Calibration
from sdimu_sim.core.truth import COEFFICIENTS, ImuTruth, in_body_frame
from sdimu_study.hidden_draw import Draw, Truth
from sdimu_study.hidden_outside import OUTSIDE, shapes

SAME_TAU = 2.0
"""Time constants within this factor are the same finding."""


def score(drawn: Draw, found: Diagnosis, sensor: ImuTruth) -> dict[str, Any]:
    """Row of a run.

    Parameters
    ----------
    drawn : Draw
    found : Diagnosis
        Made without the draw.
    sensor : ImuTruth

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
    scanned = scan(found.evidence.information, found.evidence.model, found.evidence.weight)
    named = classes(found)
    accepted = [s for s in found.found.steps if s.accepted]
    catalogue = [
        k for k in range(len(found.evidence.weight), int(found.free[0])) if np.isfinite(scanned.sigma[k])
    ]  # fmt: skip
    return {
        "kind": drawn.kind, "plan": drawn.plan, "latitude_deg": drawn.latitude_deg, "fault": drawn.fault,
        "truths": [_judge(t, found, scanned, named) for t in drawn.truths],
        "verdict": found.verdict, "sentence": found.sentence,
        "named": [c.label for c in found.chosen], "families": [c.family for c in found.chosen],
        "classes": named, "noise": list(found.noise), "data": [f.kind for f in found.findings],
        "own": found.own, "unexplained": found.unexplained,
        "steps": [
            {"label": s.label, "z": s.z, "accepted": s.accepted, "reason": s.reason, "log_bayes": s.log_bayes_factor,
             "gain": s.held_out_gain, "error": s.held_out_error} for s in found.found.steps
        ],
        "rms_z_before": baseline_rms_z(found.before, sensor), "rms_z_after": baseline_rms_z(found.after, sensor),
        "held_out_before": found.before.fit["held_out_rms"], "held_out_after": found.after.fit["held_out_rms"],
        "stops_before": accepted[0].held_out_before.rms if accepted else None,
        "stops_after": accepted[-1].held_out_after.rms if accepted else None,
        "remainder_p": found.free_inputs_after.p_value, "remainder_p_before": found.free_inputs_before.p_value,
        "scan_z2": float(np.sum(scanned.z[catalogue] ** 2)), "scan_count": len(catalogue),
        "threshold": found.found.threshold, "explained": found.explained,
    }  # fmt: skip


def classes(found: Diagnosis) -> list[list[str]]:
    """Labels of every class that was named: what was found, and what the data cannot tell from it."""
    return [[f.candidate.label, *f.alike] for f in found_effects(found)]


def same_effect(label: str, truth: Truth, stops: tuple[tuple[int, float, float], ...]) -> bool:
    """Whether a label of the catalogue names a hidden effect, its time constant or time near enough."""
    name, _, inside = label.partition("(")
    if name != truth.name:
        return False
    if truth.option is None or not inside:
        return True
    key, value = truth.option
    labelled = float(inside.rstrip(")").partition(",")[0].partition("=")[2].split()[0])
    if key == "tau":
        return 1.0 / SAME_TAU <= labelled / value <= SAME_TAU
    if key != "t0":
        return labelled == value
    # The same dwell or turn; stamps are rounded to seconds.
    edges = sorted({0.0, *(t for _, a, b in stops for t in (a, b))})
    next_to = [e for e in edges if e <= value + 1.0][-1:] + [e for e in edges if e >= value - 1.0][:1]
    return next_to[0] - 1.5 <= labelled <= next_to[-1] + 1.5


def _judge(truth: Truth, found: Diagnosis, scanned: Scan, named: list[list[str]]) -> dict[str, Any]:
    """Say how one hidden effect was found.

    ``realised``: size in the sigma of this very test; ``in_class``, ``best``: named in a class, named first;
    ``share``: of its signature, beyond the model's coefficients, that what was found takes; ``error_sigmas``: error of
    its amplitude in the refit (of the scan, when another of its class was named), None with a scanned option.
    """
    stops = found.evidence.times.stops
    row: dict[str, Any] = {
        "name": truth.name, "family": truth.family, "option": truth.option, "value": truth.value,
        "sigmas": truth.sigmas, "text": truth.text,
        "in_class": any(same_effect(x, truth, stops) for c in named for x in c) or _seen_in_samples(truth, found),
        "best": any(same_effect(c.label, truth, stops) for c in found.chosen), "share": None, "realised": None,
        "z": None, "error_sigmas": None,
    }  # fmt: skip
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


def baseline_rms_z(calibration: Calibration, sensor: ImuTruth) -> float:
    """RMS of error over sigma of the baseline coefficients that the body frame leaves free."""
    return float(np.sqrt(np.mean(baseline_z(calibration, sensor) ** 2)))


def baseline_z(calibration: Calibration, sensor: ImuTruth) -> Floats:
    """Error over sigma of the baseline coefficients that the body frame leaves free, shape (k,)."""
    truth = in_body_frame(sensor.coefficients, calibration.body_frame)
    rows = [i for i, name in enumerate(calibration.names) if name in COEFFICIENTS]
    error = np.array([calibration.values[i] - truth[calibration.names[i]] for i in rows])
    sigma = np.sqrt(np.abs(np.diag(calibration.covariance)[rows]))
    pinned = [calibration.names[i] in body_frame.pinned_names(calibration.body_frame) for i in rows]
    free = ~np.array(pinned) & (sigma > 0.0)
    return np.asarray(error[free] / sigma[free])
