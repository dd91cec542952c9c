"""What was found against what was hidden, by name, and errors over sigma."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.diagnosis.diagnose import Diagnosis
from sdimu_calibration.core.diagnosis.found import found_effects
from sdimu_calibration.core.effects import body_frame
from sdimu_calibration.core.results import Calibration
from sdimu_sim.core.truth import COEFFICIENTS, ImuTruth, in_body_frame
from sdimu_study.worlds import OneTest, Truth

SAME_TAU = 2.0
"""Time constants within this factor are the same finding."""
Stops = tuple[tuple[int, float, float], ...]
"""Index, start and end (s) of every dwell."""


def classes(found: Diagnosis) -> list[list[str]]:
    """Labels of every class that was named: what was found, and what the data cannot tell from it."""
    return [[f.candidate.label, *f.alike] for f in found_effects(found)]


def same_effect(label: str, truth: Truth, stops: Stops) -> bool:
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


def among(truth: Truth | None, labels: Iterable[str], stops: Stops) -> bool:
    """Whether one of the labels names a hidden effect."""
    return truth is not None and any(same_effect(label, truth, stops) for label in labels)


def baseline_z(calibration: Calibration, sensor: ImuTruth) -> Floats:
    """Error over sigma of the baseline coefficients that the body frame leaves free, shape (k,)."""
    truth = in_body_frame(sensor.coefficients, calibration.body_frame)
    rows = [i for i, name in enumerate(calibration.names) if name in COEFFICIENTS]
    error = np.array([calibration.values[i] - truth[calibration.names[i]] for i in rows])
    sigma = np.sqrt(np.abs(np.diag(calibration.covariance)[rows]))
    pinned = [calibration.names[i] in body_frame.pinned_names(calibration.body_frame) for i in rows]
    free = ~np.array(pinned) & (sigma > 0.0)
    return np.asarray(error[free] / sigma[free])


def errors(calibration: Calibration, sensor: ImuTruth) -> dict[str, Any]:
    """Sum of squares, number and largest of `baseline_z`."""
    z = baseline_z(calibration, sensor)
    return {"z2": float(np.sum(z**2)), "count": len(z), "largest_z": float(np.max(np.abs(z)))}


def scored(world: OneTest, found: Diagnosis) -> dict[str, Any]:
    """Row of a diagnosis of one test with one hidden effect or none, and what was drawn."""
    return scored_row(found, world.sensor, world.truth) | dict(world.told)


def scored_row(found: Diagnosis, sensor: ImuTruth, truth: Truth | None) -> dict[str, Any]:
    """Score a diagnosis by the truth: errors over sigma of the coefficients, whether the effect was named."""
    named, stops = classes(found), found.evidence.times.stops
    row = {
        "estimator": found.fit.estimator,
        "verdict": found.verdict,
        "sentence": found.sentence,
        "named": named,
        **errors(found.after, sensor),
        "held_out": found.after.fit["held_out_rms"],
        "accuses": any(f.grave for f in found.findings),
    }
    if truth is None:
        return row
    in_class, first = any(among(truth, one, stops) for one in named), bool(named) and among(truth, named[0][:1], stops)
    return row | {"truth": truth.text, "sigmas": truth.sigmas, "in_class": in_class, "first": first}
