"""What to do next after the diagnosis of a handheld run."""

from __future__ import annotations

from sdimu_calibration.core.advice import Advice, Kind
from sdimu_calibration.core.diagnosis.advice import keep, mend, together
from sdimu_calibration.core.diagnosis.diagnose import Diagnosis
from sdimu_calibration.core.diagnosis.found import Found
from sdimu_calibration.core.effects.effect import Excitation
from sdimu_calibration.core.verdict import Verdict


def handheld_advice(d: Diagnosis, found: tuple[Found, ...]) -> tuple[Advice, ...]:
    """Advise, the most useful first."""
    out = [*mend(d), *keep(found), *together([(one, _more(one)) for one in found if one.alike])]
    out += [
        Advice(Kind.CHOICE_MATTERS_BY_HAND, (one.candidate.label, s.other, s.coefficient, s.sigmas))
        for one in found if one.alike for s in one.coefficient_shifts[:3]
    ]  # fmt: skip
    if d.verdict == Verdict.UNEXPLAINED:
        out.append(Advice(Kind.RECORD_IN_OTHER_ORDER))
    return tuple(dict.fromkeys(out))


def _more(one: Found) -> Advice:
    """Say what to do by hand that would tell a class apart."""
    if Excitation.REPEATED_ATTITUDES in one.candidate.effect.excitation:
        return Advice(Kind.COME_BACK)
    if one.candidate.effect.terms[0].channel < 3:
        return Advice(Kind.TURN_BOTH_WAYS)
    return Advice(Kind.REST_BETWEEN)
