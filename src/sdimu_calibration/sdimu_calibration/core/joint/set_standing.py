"""Where a set leaves its unit: what all of its recordings know of it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from sdimu_calibration.core.effects import imu_model
from sdimu_calibration.core.evidence.candidate import Candidate
from sdimu_calibration.core.evidence.known import Standing, class_of, in_frame_of_priors, is_lasting, known_of
from sdimu_calibration.core.joint.set_evidence import SetEvidence
from sdimu_calibration.core.joint.set_fit import SetFit


def set_standing(
    fit: SetFit, evidence: SetEvidence, kept: Mapping[str, Candidate], alike: Mapping[str, Sequence[str]]
) -> Standing:
    """Say what all recordings of a set know of the unit.

    Parameters
    ----------
    fit : SetFit
        With everything that was found.
    evidence : SetEvidence
        About it, with the candidates that may look the same.
    kept : mapping of str to Candidate
        What was found, by label.
    alike : mapping of str to sequence of str
        By label, what the set cannot tell from it.
    """
    place = {name: k for k, name in enumerate(evidence.names)}
    first = len(evidence.weight)
    more: dict[str, int] = {}
    classes, labels = [], dict.fromkeys(label for label, c in kept.items() if is_lasting(c.effect))
    for label, found in kept.items():
        others = [evidence.candidates[place[name] - first] for name in alike.get(label, ()) if name in place]
        members = class_of(found, others)
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
