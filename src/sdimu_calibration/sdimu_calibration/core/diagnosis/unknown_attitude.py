"""Whether an error that follows the attitude is worth a search in which every sample sees it where it is.

Every search tries its mean over each stretch. Functions of the attitude are exact, and cost some hundred columns more.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.diagnosis.ground import Request
from sdimu_calibration.core.diagnosis.search import Search
from sdimu_calibration.core.evidence.joint_information import Joint
from sdimu_calibration.core.evidence.learned_noise import InModes
from sdimu_calibration.core.evidence.linear import LinearEvidence
from sdimu_calibration.core.evidence.wander import Wander
from sdimu_calibration.core.noise_term import ATTITUDE, TRIADS, NoiseTerm
from sdimu_calibration.core.posterior.noise_models import SENSORS

_GAIN = 4.0
"""Log-likelihood (1) from which functions of the attitude are looked at: their odds make up for as much."""
_HINT = 1.0
"""Log-likelihood (1) that the mean over stretches must gain before functions are worked out: half a second that
recordings with plain noise need not take."""


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
    board, told = window.board, window.told
    known = evidence.only(np.array(board.columns(told.members), dtype=np.int64))
    weight = board.parameters(told.members)[1]
    # Its mean in each stretch would take it up.
    beside = [term for term in told.noise.terms if term.kind != ATTITUDE]
    if _gain(request.wander, known, weight, beside) < _HINT:
        return request
    wander = request.wander.with_functions(evidence)
    return replace(request, wander=wander) if _gain(wander, known, weight, beside) > _GAIN else request


def _gain(wander: Wander, known: LinearEvidence, weight: Floats, beside: Sequence[NoiseTerm]) -> float:
    """Log-likelihood that an error which follows the attitude adds in the sensors that show it best (1).

    Parameters
    ----------
    known : LinearEvidence
        Of what is estimated along alone, with its prior information `weight`, shape (p,).
    beside : sequence of NoiseTerm
        Noise of the model.
    """
    information = Joint.of(known, wander).on_wander(np.arange(len(weight)), weight)
    gains = []
    for triad in TRIADS:
        modes = InModes.of(information.of_triad(triad, beside, wander.cut), wander.cut, ATTITUDE, 0.0)
        gains += [modes.sizes_on_grid(axes)[1] for axes in SENSORS]
    return float(np.max(np.concatenate(gains), initial=0.0))
