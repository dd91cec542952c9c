"""What to do next, as data with minutes: about what was found, and about what this plan cannot show.

What is open is closed by the turn that the covariance says (`closing`); a change with time, which no plan foresees, by
the same attitude twice. What the plan cannot show at all follows from observability on a rate table: an even function
of the rate needs both senses of turn, its shape two rates, a product of forces stops between the axes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from sdimu_calibration.core.advice import Advice, Kind, Verb
from sdimu_calibration.core.diagnosis.closing import TELLS, Closing, closing_advice, next_recording
from sdimu_calibration.core.diagnosis.coefficient_shifts import CoefficientShift
from sdimu_calibration.core.diagnosis.diagnose import Diagnosis
from sdimu_calibration.core.diagnosis.found import DetectableSize, Found
from sdimu_calibration.core.diagnosis.grades import NAMED, graded, other_coefficients, without_variant
from sdimu_calibration.core.diagnosis.measured_noise import is_off, of_other_grade
from sdimu_calibration.core.diagnosis.plan_seen import PlanSeen
from sdimu_calibration.core.diagnosis.screen import Finding
from sdimu_calibration.core.diagnosis.standing import standing
from sdimu_calibration.core.effects import references, registry, selection
from sdimu_calibration.core.effects.effect import Effect, Excitation
from sdimu_calibration.core.evidence.consistency import Noise
from sdimu_calibration.core.evidence.testable import TESTABLE
from sdimu_calibration.core.noise_term import FOLLOWS
from sdimu_calibration.core.plan_search import Question
from sdimu_calibration.core.posterior.told import Probabilities
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.verdict import Verdict

NOT_BY_HAND = "the motion of this run does not excite it"
"""Reason why a run by hand does not show an effect."""
_TOO_SMALL = "at no size that a sensor has does it stand out of the noise"
"""Reason why a test does not show an effect that it excites."""
_SLOW_MINUTES = 20.0
"""Length of the stay that is advised for a change with time (min): usual time constants of a warm-up lie within it."""
_MOST_STAKES = 3
"""Number of coefficients at stake that one advice names: diagnosis.json has the rest."""


class Reason(NamedTuple):
    """Why a test does not show an effect."""

    why: str
    drive: str = ""
    """What to drive that shows it; empty where no turn does."""

    @property
    def text(self) -> str:
        """Both, as people read them."""
        return f"{self.why}: {self.drive}" if self.drive else self.why


@dataclass(frozen=True)
class Untestable:
    """Effects that could not have been seen, all for one reason."""

    because: Reason
    labels: tuple[str, ...]

    @property
    def reason(self) -> str:
        """Why not, and what would show them."""
        return self.because.text


def untestable_reasons(reached: tuple[DetectableSize, ...], plan: PlanSeen) -> tuple[Untestable, ...]:
    """Sort what is not testable by the reason; the largest groups first."""
    return _sorted(reached, lambda one: reason(one, plan))


def untestable_by_hand(reached: tuple[DetectableSize, ...]) -> tuple[Untestable, ...]:
    """Sort what a run by hand does not show by the reason; the largest groups first."""
    return _sorted(reached, lambda one: Reason(_TOO_SMALL if _shows(one) else NOT_BY_HAND))


def _sorted(reached: tuple[DetectableSize, ...], why: Callable[[DetectableSize], Reason]) -> tuple[Untestable, ...]:
    groups: dict[Reason, list[str]] = {}
    for one in reached:
        if not one.testable:
            groups.setdefault(why(one), []).append(one.label)
    ordered = sorted(groups.items(), key=lambda item: -len(item[1]))
    return tuple(Untestable(because, tuple(labels)) for because, labels in ordered)


def _shows(one: DetectableSize) -> bool:
    """Whether a test shows an effect, if only at a size that no sensor has."""
    return one.retention > TESTABLE and bool(np.isfinite(one.smallest))


def reason(one: DetectableSize, plan: PlanSeen) -> Reason:
    """Say why a candidate is not testable with this plan."""
    effect = registry.find(one.family)
    needed = effect.excitation if effect else frozenset()
    if effect and effect.never_seen:
        return Reason(effect.never_seen)
    if Excitation.BOTH_SENSES in needed and plan.one_sided():
        return Reason(_senses(plan), "drive some negative (the second turn of each 180 deg pair costs nothing)")
    if Excitation.TWO_RATES in needed and plan.one_rate():
        return Reason(_rates(plan), "drive every other turn at another rate, such as 2 and 10 deg/s")
    if Excitation.TWO_AXES in needed:
        return Reason("every turn is about one body axis", "needs turns about two at once")
    if Excitation.OBLIQUE_STOPS in needed and not plan.oblique:
        return Reason("no stop lies between the body axes", "split turns of 90 deg into halves of 45 deg")
    if _shows(one):
        return Reason(_TOO_SMALL)
    if one.partners:
        return Reason("coefficients of the model take it")
    return Reason("the motion of this test does not excite it")


def advice(
    d: Diagnosis, found: tuple[Found, ...], reached: tuple[DetectableSize, ...], plan: PlanSeen
) -> tuple[Advice, ...]:
    """Advise, the most useful first."""
    out = [*_about_data(d), *_about_found(d, found, plan), *_about_plan(reached, plan)]
    return recorded_first(dict.fromkeys(out))


_RECORDS = frozenset(
    {
        Kind.RECORD_ONCE_MORE,
        Kind.NO_TURN_TELLS,
        Kind.NO_PLAN_TELLS,
        Kind.PLAN_NEXT,
        Kind.TELL_APART,
        Kind.RECORD_MORE,
        Kind.RANK_TURNS,
    }
)
"""What says how to record what is open: before an effect that is open goes into the model."""


def recorded_first(advice: Iterable[Advice]) -> tuple[Advice, ...]:
    """Put what goes into the model after a recording more behind the advice what to record."""
    every = tuple(advice)
    last = max((k for k, one in enumerate(every) if one.kind in _RECORDS), default=-1)
    before = every[: last + 1]
    now, afterwards = ([one for one in before if (one.kind == Kind.TRY) is late] for late in (False, True))
    return (*now, *afterwards, *every[last + 1 :])


def mend(d: Diagnosis) -> list[Advice]:
    """Advise about every grave fault of the data: what mends it, where something does."""
    return [_mended(finding) for finding in d.findings if finding.grave]


def _mended(fault: Finding) -> Advice:
    if not fault.kind:
        return Advice(Kind.LOOK_FIRST, (fault.text,))
    begin, end = np.floor(10.0 * fault.start_s) / 10.0, np.ceil(10.0 * fault.end_s) / 10.0
    if fault.kind == "long gap":
        return Advice(Kind.PART_RECORDING, (fault.text,), Verb.CUT, (f"{begin:.1f}", f"{end:.1f}"))
    if fault.kind == "saturated":
        return Advice(Kind.LEAVE_OUT_TIMES, (fault.text,), Verb.LEAVE_OUT, (f"{begin:.1f}-{end:.1f}",))
    return Advice(Kind.MEND_RECORDING, (fault.text,))


def _about_data(d: Diagnosis) -> list[Advice]:
    out = mend(d)
    # What follows attitude, rate or temperature is the same in every repetition.
    if any(term.kind not in FOLLOWS for term in d.found.noise):
        out.append(Advice(Kind.REPEAT_STOPS))
    if grades := of_other_grade(d.noise):
        # A factor would make a file of another IMU out of it, with the priors of this one.
        return [*(Advice(Kind.OTHER_GRADE, (line,)) for line in grades), *out]
    if len(d.noise) > len(d.found.noise):
        out.append(Advice(Kind.CORRECT_NOISE, tuple(map(_factor, (d.consistency.gyro, d.consistency.accel)))))
    return out


def _factor(noise: Noise) -> float:
    """Ratio (1) of the white noise of a triad to that specified; 1 where nothing says that it is another one."""
    return noise.ratio if is_off(noise) else 1.0


def _about_found(d: Diagnosis, found: tuple[Found, ...], plan: PlanSeen) -> list[Advice]:
    if d.verdict == Verdict.UNEXPLAINED:
        return _about_unknown(d, found)
    out = add([one for one in found if _belongs(one)], d.probabilities)
    if not found and d.verdict == Verdict.CLASS_OF_EFFECTS:
        out += _about_many(d)
    for one in found:
        if one.candidate.family == references.LATITUDE.name:
            out.append(Advice(Kind.CORRECT_LATITUDE, (one.value, one.sigma)))
        elif one.candidate.effect.scope == "recording":
            out.append(Advice(Kind.RECORD_AGAIN, (one.candidate.label,)))
    closing = _closing(d, found)
    closed = {members[0] for members, _ in closing}
    still_open = [one for one in found if others(one) and one.candidate.label not in closed]
    out += closing_advice(closing)
    out += [_by_temperature(one) for one in still_open if _hangs_on_heat(one)]
    out += together([(one, telling_stay(one.candidate.effect, plan)) for one in still_open if not _hangs_on_heat(one)])
    return out + [_at_stake(one) for one in found if _in_sight(one)]


def _closing(d: Diagnosis, found: Sequence[Found]) -> Closing:
    """Find what to record next to tell apart what is open; nothing where there is no site."""
    test = d.fit.test
    if test.site is None or not any(map(others, found)):
        return []
    values = {one.candidate.parameter.name: one.value for one in found}
    every = next_recording(standing(d, found), Question(test.site, test.imu, d.fit.model), values)
    # A change with time shows in a long stay: a whole plan is no better advice.
    by_stay = {one.candidate.label for one in found if Excitation.REPEATED_ATTITUDES in one.candidate.effect.excitation}
    return [(members, turn) for members, turn in every if turn.after >= TELLS or members[0] not in by_stay]


def _hangs_on_heat(one: Found) -> bool:
    """Whether an effect, or the likeliest of what looks the same, is one of the temperature: no turn shows it."""
    rival = others(one)[0]
    of_rival = selection.resolve(rival).needs if in_catalogue(rival) else ""
    return "temperature" in {one.candidate.effect.needs, of_rival}


def _by_temperature(one: Found) -> Advice:
    return Advice(Kind.NO_PLAN_TELLS, (one.candidate.label, others(one)[0]))


def _about_many(d: Diagnosis) -> list[Advice]:
    """Advise where something is missing, and no effect by itself is likely."""
    families = d.probabilities.families if d.probabilities is not None else ()
    members = sorted((one for family in families for one in family.members), key=lambda one: -one.probability)
    names = tuple(one.label for one in members if in_catalogue(one.label))[:2]
    turns = [Advice(Kind.RANK_TURNS, (), Verb.RANK_TURNS, names)] if len(names) > 1 else []
    return [Advice(Kind.RECORD_MORE), *turns]


def _about_unknown(d: Diagnosis, found: tuple[Found, ...]) -> list[Advice]:
    worst = d.consistency.where[0] if d.consistency.where else None
    place = (worst.stop, worst.channel) if worst else (None, "")
    out = [Advice(Kind.UNKNOWN_CAUSE, (*place, bool(d.found.noise))), Advice(Kind.RUN_BACKWARDS, (), Verb.REVERSE_PLAN)]
    near = tuple(f.candidate.label for f in found if not f.decided)
    return out + ([Advice(Kind.TRY_EQUATION, near)] if near else [])


def add(found: Sequence[Found], told: Probabilities | None = None) -> list[Advice]:
    """Advise how what was found gets into the model: what is decided to stay, what is open to be tried."""
    grades = graded(found, told)
    return adding(
        [
            (one.candidate.label, one.candidate.added, one.decided and not grade.is_open)
            for one, grade in zip(found, grades, strict=True)
        ]
    )


def adding(found: Sequence[tuple[str, str, bool]]) -> list[Advice]:
    """Advise the same of labels, each with the key that adds it, and whether it is decided."""
    decided, doubtful = ([one for one in found if one[2] is sure] for sure in (True, False))
    out = [_adding(Kind.KEEP, decided, decided)] if decided else []
    return [*out, _adding(Kind.TRY, doubtful, found)] if doubtful else out


def _adding(kind: Kind, named: Sequence[tuple[str, str, bool]], added: Sequence[tuple[str, str, bool]]) -> Advice:
    label = named[0][0] if len(named) == 1 else None
    return Advice(kind, (label,), Verb.ADD, tuple(key for _, key, _ in added))


def others(one: Found) -> tuple[str, ...]:
    """Labels of what looks the same as an effect and is another coefficient: no other time constant of its own."""
    return other_coefficients(one.candidate.label, one.alike)


def together(asked: Sequence[tuple[Found, Advice]]) -> list[Advice]:
    """Say what tells classes apart, one advice for each thing to do.

    Parameters
    ----------
    asked : sequence of (Found, Advice)
        What was found, and what to do to tell it from what looks the same.
    """
    groups: dict[Advice, list[tuple[str, tuple[str, ...]]]] = {}
    for one, what in asked:
        groups.setdefault(what, []).append((one.candidate.label, others(one)[:3]))
    return [Advice(Kind.TELL_APART, (tuple(pairs), what)) for what, pairs in groups.items()]


def _belongs(one: Found) -> bool:
    """Whether an effect belongs into the model of the sensor: no wrong site, no fault of one recording."""
    return one.candidate.family != references.LATITUDE.name and one.candidate.effect.scope != "recording"


def _at_stake(one: Found) -> Advice:
    """Say which coefficients are right only if the named member of a class is the right one, by members in sight."""
    largest: dict[str, CoefficientShift] = {}
    for stake in sorted(_in_sight(one), key=lambda s: -abs(s.sigmas)):
        largest.setdefault(stake.coefficient, stake)
    stakes = tuple((s.other, s.coefficient, s.sigmas) for s in list(largest.values())[:_MOST_STAKES])
    return Advice(Kind.CHOICE_MATTERS, (one.candidate.label, stakes))


def _in_sight(one: Found) -> list[CoefficientShift]:
    """Coefficients that move with members of the class that are named beside it: others are too improbable."""
    named = {share.name for share in one.may_be if share.probability >= NAMED}
    return [s for s in one.coefficient_shifts if not one.may_be or without_variant(s.other) in named]


def telling_stay(effect: Effect, plan: PlanSeen) -> Advice:
    """Say what would tell an effect from what looks the same where no plan foresees it, with minutes."""
    dwell = max(plan.dwell_minutes, 1.0)
    if Excitation.REPEATED_ATTITUDES in effect.excitation:
        return Advice(Kind.STAY_AND_RETURN, (_SLOW_MINUTES, dwell + 1.0))
    return Advice(Kind.REPEAT_TURN, (2 * (dwell + 0.5),))


def in_catalogue(name: str) -> bool:
    """Whether a label is one of a registered effect, and of no equation."""
    try:
        selection.resolve(name)
    except DataError:
        return False
    return True


def _about_plan(reached: tuple[DetectableSize, ...], plan: PlanSeen) -> list[Advice]:
    out = []
    hidden = [effect.excitation for r in reached if not r.testable and (effect := registry.find(r.family))]
    if any(Excitation.BOTH_SENSES in needed for needed in hidden) and plan.one_sided():
        out.append(Advice(Kind.SIGNED_TURNS, (_senses(plan),)))
    if {Excitation.TWO_RATES} in hidden and plan.one_rate():
        out.append(Advice(Kind.TWO_RATES, (_rates(plan),)))
    return out


def _senses(plan: PlanSeen) -> str:
    axes = plan.one_sided()
    word = {1: "positive", -1: "negative"}
    if len(axes) == 3 and len({sign for _, sign in axes}) == 1:
        return f"all turns are {word[axes[0][1]]}"
    return "all turns about " + ", ".join(f"{letter} are {word[sign]}" for letter, sign in axes)


def _rates(plan: PlanSeen) -> str:
    axes = plan.one_rate()
    return "all turns have one rate" if len(axes) == 3 else f"all turns about {', '.join(axes)} have one rate"


def handheld_advice(d: Diagnosis, found: tuple[Found, ...]) -> tuple[Advice, ...]:
    """Advise, the most useful first."""
    out = [
        *mend(d),
        *add(found, d.probabilities),
        *together([(one, _more_handheld(one)) for one in found if others(one)]),
    ]
    out += [
        Advice(Kind.CHOICE_MATTERS_HANDHELD, (one.candidate.label, s.other, s.coefficient, s.sigmas))
        for one in found
        if others(one)
        for s in _in_sight(one)[:3]
    ]
    if d.verdict == Verdict.UNEXPLAINED:
        out.append(Advice(Kind.RECORD_IN_OTHER_ORDER))
    if not found and d.verdict == Verdict.CLASS_OF_EFFECTS:
        out.append(Advice(Kind.RECORD_MORE))
    return recorded_first(dict.fromkeys(out))


def _more_handheld(one: Found) -> Advice:
    """Say what to do by hand that would tell a class apart."""
    if Excitation.REPEATED_ATTITUDES in one.candidate.effect.excitation:
        return Advice(Kind.COME_BACK)
    if one.candidate.effect.terms[0].channel < 3:
        return Advice(Kind.TURN_BOTH_WAYS)
    return Advice(Kind.REST_BETWEEN)
