"""Where a diagnosis of one recording leaves the unit: what the next recording begins with."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.diagnosis.diagnose import Diagnosis
from sdimu_calibration.core.diagnosis.found import Found
from sdimu_calibration.core.effects import selection
from sdimu_calibration.core.effects.effect import Effect
from sdimu_calibration.core.evidence.candidate import Candidate
from sdimu_calibration.core.evidence.known import Known, Standing, class_of, in_frame_of_priors, is_lasting, known_of


def standing(d: Diagnosis, found: Sequence[Found]) -> Standing:
    """Say what a recording knows of the unit.

    Parameters
    ----------
    found : sequence of Found
        Its found effects.
    """
    evidence, p = d.evidence, len(d.evidence.weight)
    place = {name: k for k, name in enumerate(evidence.names)}
    members: dict[str, Candidate] = {}
    classes = []
    for one in found:
        others = [evidence.candidates[place[label] - p] for label in one.alike]
        together = class_of(one.candidate, others)
        if together:
            classes.append(tuple(c.label for c in together))
        members |= {c.label: c for c in together or (one.candidate,) if is_lasting(c.effect)}
    own = known_of(evidence, np.array([place[label] for label in members], dtype=np.int64))
    known = in_frame_of_priors(own, d.fit.sensors)
    effects: list[str | Effect] = [*d.fit.model.effects, *(c.effect for c in members.values())]
    of_power_on = {name for effect in effects for name in _of_power_on(effect)}
    test = d.fit.test
    return Standing(
        _anew(known, of_power_on),
        tuple(members),
        tuple(classes),
        test.origin.imu_file or test.imu.name,
        test.origin.site_stated,
    )


def _of_power_on(effect: str | Effect) -> tuple[str, ...]:
    """Coefficients of an effect that are others after the next switching-on."""
    known = selection.resolve(effect)
    return tuple(p.name for p in known.parameters) if known.scope == "power-on" else ()


def _anew(known: Known, names: set[str]) -> Known:
    """Let coefficients differ by their priors in the next recording: how far they do, one recording cannot say."""
    scatter: Floats = np.array(
        [
            prior if name in names and np.isfinite(prior) else 0.0
            for name, prior in zip(known.names, known.prior.tolist(), strict=True)
        ]
    )
    return Known(known.names, known.J, known.prior, scatter)
