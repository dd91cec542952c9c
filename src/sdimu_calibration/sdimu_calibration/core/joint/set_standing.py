"""Where a set leaves its unit: what all of its recordings know of it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from sdimu_calibration.core.effects import imu_model
from sdimu_calibration.core.evidence.known import Standing, class_of, in_frame_of_priors, is_lasting, known_of
from sdimu_calibration.core.joint.set_evidence import SetEvidence
from sdimu_calibration.core.joint.set_fit import SetFit
from sdimu_calibration.core.joint.set_found import Find


def set_standing(fit: SetFit, evidence: SetEvidence, finds: Sequence[Find]) -> Standing:
    """Say what all recordings of a set know of the unit.

    Parameters
    ----------
    fit : SetFit
        With everything that was found.
    evidence : SetEvidence
        About it, with the candidates that may look the same.
    finds : sequence of Find
        What was found in all recordings.
    """
    place = {name: k for k, name in enumerate(evidence.names)}
    first = len(evidence.weight)
    more: dict[str, int] = {}
    kept = {find.candidate.label: find.candidate for find in finds}
    classes, labels = [], dict.fromkeys(label for label, c in kept.items() if is_lasting(c.effect))
    for find in finds:
        others = [evidence.candidates[place[name] - first] for name in find.alike if name in place]
        members = class_of(find.candidate, others)
        if members:
            classes.append(tuple(c.label for c in members))
            labels |= dict.fromkeys(classes[-1])
            more |= {c.label: place[c.label] for c in members[1:] if c.label not in kept}
    own_frame = known_of(evidence, np.array(list(more.values()), dtype=np.int64))
    known = in_frame_of_priors(own_frame, imu_model.build(fit.model.effects, fit.reports[0].imu))
    sizes = dict.fromkeys((n for own in fit.varying.values() for n in own), math.inf)
    for t, own in zip(fit.turn_on, fit.varying.values(), strict=False):
        sizes |= dict.fromkeys(own, t.sigma)
    # With one power-on nobody knows how far the next one is off: as far as the prior says.
    scatter = np.minimum([sizes.get(name, 0.0) for name in known.names], known.prior)
    return Standing(
        replace(known, scatter=np.where(np.isfinite(scatter), scatter, 0.0)),
        tuple(labels),
        tuple(classes),
        fit.reports[0].imu.name,
    )
