"""Score all candidates against a fit, without adding any: what a person looks at who decides alone."""

from __future__ import annotations

import numpy as np

from sdimu_calibration.core.arrays import Ints
from sdimu_calibration.core.diagnosis.candidates import free_inputs
from sdimu_calibration.core.diagnosis.diagnose import Diagnosis
from sdimu_calibration.core.diagnosis.ground import Request, candidates
from sdimu_calibration.core.diagnosis.problem import Problem
from sdimu_calibration.core.diagnosis.rounds import UNEXPLAINED_P, left
from sdimu_calibration.core.diagnosis.search import FALSE_ALARM, Search
from sdimu_calibration.core.estimation.fit import Fit
from sdimu_calibration.core.evidence.linear import LinearEvidence
from sdimu_calibration.core.results import Calibration
from sdimu_calibration.core.verdict import Verdict


def survey(fit: Fit, result: Calibration, with_candidates: bool = True) -> Diagnosis:
    """Score all candidates, or none, against a fit.

    Parameters
    ----------
    with_candidates : bool
        Without them only the residuals are worked out.
    """
    known = candidates(Request(fit, (), FALSE_ALARM), (), own=False) if with_candidates else []
    free = free_inputs(fit.timetable) if with_candidates and fit.free_inputs_testable else []
    evidence = fit.evidence([*known, *free])
    p = len(evidence.weight)
    border = p + sum(len(effect.parameters) for effect in known)
    free_columns = np.arange(border, len(evidence.names))
    found = _nothing_added(evidence, np.arange(p, border))
    rest = left(evidence, found.chosen, free_columns)
    standing = int(np.sum(np.abs(found.first.z) > found.threshold))
    adequate = with_candidates and standing == 0 and rest.p_value > UNEXPLAINED_P
    best = evidence.names[int(np.argmax(np.abs(found.first.z)))]
    sentence = (
        "Nothing stands out of the noise."
        if adequate
        else f"{standing} candidates stand out of the noise, {best} most."
        if standing
        else "Something is left that no candidate stands for."
    )
    return Diagnosis(
        Verdict.CONSISTENT if adequate else Verdict.MISFIT,
        (sentence,),
        adequate,
        rest.p_value,
        (),
        (),
        fit.consistency(),
        fit,
        fit,
        result,
        result,
        found,
        evidence,
        rest,
        rest,
        free_columns,
        own=False,
        alarms=frozenset(),
    )


def _nothing_added(evidence: LinearEvidence, columns: Ints) -> Search[LinearEvidence]:
    problem = Problem(evidence.only(columns))
    first = problem.scan([])
    none = np.empty(0, dtype=np.int64)
    return Search((), none, first, problem.threshold(first, FALSE_ALARM), evidence)
