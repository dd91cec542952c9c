"""What to do next after the diagnosis of a handheld run."""

from __future__ import annotations

from sdimu_calibration.core.diagnosis.advice import keep, together
from sdimu_calibration.core.diagnosis.diagnose import Diagnosis
from sdimu_calibration.core.diagnosis.found import Found
from sdimu_calibration.core.effects.effect import Excitation
from sdimu_calibration.core.verdict import Verdict


def handheld_advice(d: Diagnosis, found: tuple[Found, ...]) -> tuple[str, ...]:
    """Advise in sentences, the most useful first."""
    out = [f"Mend the recording first: {f.text}." for f in d.findings if f.grave]
    out += keep(found)
    out += together([(one, _more(one)) for one in found if one.alike])
    for one in found:
        label = one.candidate.label
        if one.alike:
            out += [
                f"Which it is matters: with {s.other} instead of {label}, {s.coefficient} moves by {s.sigmas:+.0f} of "
                "its sigmas." for s in one.coefficient_shifts[:3]
            ]  # fmt: skip
    if d.verdict == Verdict.UNEXPLAINED:
        out.append(
            "Record the run again in another order, and diagnose both recordings together (sdimu diagnose FIRST "
            "SECOND): that says whether it comes back at the same attitude, time or temperature, or is of this run."
        )
    return tuple(dict.fromkeys(out))


def _more(one: Found) -> str:
    """Say what to do by hand that would tell a class apart."""
    if Excitation.REPEATED_ATTITUDES in one.candidate.effect.excitation:
        return "come back to the first attitudes at the end, and rest there"
    if one.candidate.effect.terms[0].channel < 3:
        return "turn about that axis both ways, slowly and fast"
    return "rest in more attitudes between the axes, both ends of that axis up"
