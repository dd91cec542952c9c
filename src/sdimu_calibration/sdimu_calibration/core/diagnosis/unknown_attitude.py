"""Whether an error that follows the attitude is worth a search in which every sample sees it where it is.

Its mean over a stretch is worked out in every search; exact are functions of the attitude, some hundred columns more.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sdimu_calibration.core.diagnosis.ground import Request
from sdimu_calibration.core.diagnosis.search import Search
from sdimu_calibration.core.evidence.joint_information import Joint
from sdimu_calibration.core.evidence.learned_noise import given_terms, sizes_on_grid
from sdimu_calibration.core.evidence.linear import LinearEvidence
from sdimu_calibration.core.noise_term import ATTITUDE, TRIADS, NoiseTerm

_GAIN = 4.0
"""Log-likelihood (1) from which functions of the attitude are looked at: their odds make up for as much."""


def with_attitude_functions(request: Request, found: Search[LinearEvidence]) -> Request:
    """Return the request with functions of the attitude in its wander, where what a search found leaves room for them.

    Parameters
    ----------
    found : Search
        In stretches.
    """
    window, evidence = found.posterior, found.evidence if found.white is None else found.white
    if request.wander is None or window is None:
        return request
    wander = request.wander.with_functions(evidence)
    told = window.board.columns(window.told.members)
    known = evidence.only(np.array(told, dtype=np.int64))
    weight = window.board.parameters(window.told.members)[1]
    information = Joint.of(known, wander).on_wander(np.arange(len(weight)), weight)
    # Its mean in each stretch would take it up.
    beside = [term for term in window.told.noise.terms if term.kind != ATTITUDE]
    for triad in TRIADS:
        _, gain = sizes_on_grid(
            *given_terms(information, wander.cut, beside, triad), wander.cut, NoiseTerm(triad, ATTITUDE)
        )
        if gain.max(initial=0.0) > _GAIN:
            return replace(request, wander=wander)
    return request
