"""What to do next, in words with minutes: about what was found, and about what this plan cannot show.

The rules are those of observability on a rate table: an even function of the rate needs both senses of turn, its shape
two rates, a product of forces stops between the axes, a change with time the same attitude twice.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sdimu_calibration.core.diagnosis.coefficient_shifts import CoefficientShift
from sdimu_calibration.core.diagnosis.diagnose import Diagnosis
from sdimu_calibration.core.diagnosis.found import DetectableSize, Found
from sdimu_calibration.core.diagnosis.plan_seen import PlanSeen
from sdimu_calibration.core.effects import references, registry, selection
from sdimu_calibration.core.effects.effect import Effect, Excitation
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.verdict import Verdict

_SLOW_MINUTES = 20.0
"""Length of the stay that is advised for a change with time (min): usual time constants of a warm-up lie within it."""
_MOST_STAKES = 3
"""Number of coefficients at stake that one sentence names: diagnosis.json has the rest."""


@dataclass(frozen=True)
class Untestable:
    """Effects that could not have been seen, all for one reason.

    Attributes
    ----------
    reason : str
        Why not, and what would show them.
    labels : tuple of str
        What `sdimu calibrate --add` takes.
    """

    reason: str
    labels: tuple[str, ...]


def untestable_reasons(reached: tuple[DetectableSize, ...], plan: PlanSeen) -> tuple[Untestable, ...]:
    """Sort what is not testable by the reason; the largest groups first."""
    groups: dict[str, list[str]] = {}
    for one in reached:
        if not one.testable:
            groups.setdefault(reason(one, plan), []).append(one.label)
    ordered = sorted(groups.items(), key=lambda item: -len(item[1]))
    return tuple(Untestable(why, tuple(labels)) for why, labels in ordered)


def reason(one: DetectableSize, plan: PlanSeen) -> str:
    """Say why a candidate is not testable with this plan."""
    effect = registry.find(one.family)
    needed = effect.excitation if effect else frozenset()
    if effect and effect.never_seen:
        return effect.never_seen
    if Excitation.BOTH_SENSES in needed and plan.one_sided():
        return f"{_senses(plan)}: drive some negative (the second turn of each 180 deg pair costs nothing)"
    if Excitation.TWO_RATES in needed and plan.one_rate():
        return f"{_rates(plan)}: drive every other turn at another rate, such as 2 and 10 deg/s"
    if Excitation.TWO_AXES in needed:
        return "every turn is about one body axis: needs turns about two at once"
    if Excitation.OBLIQUE_STOPS in needed and not plan.oblique:
        return "no stop lies between the body axes: split turns of 90 deg into halves of 45 deg"
    if one.partners:
        return "coefficients of the model take it"
    return "the motion of this test does not excite it"


def advice(
    d: Diagnosis, found: tuple[Found, ...], reached: tuple[DetectableSize, ...], plan: PlanSeen
) -> tuple[str, ...]:
    """Advise in sentences, the most useful first."""
    out = [*_about_data(d), *_about_found(d, found, plan), *_about_plan(reached, plan)]
    return tuple(dict.fromkeys(out))


def _about_data(d: Diagnosis) -> list[str]:
    out = [f"Mend the recording first: {f.text}." for f in d.findings if f.grave]
    if d.found.noise:
        out.append(
            "The noise has a memory, which no compensation removes; values and sigmas take it into account. More "
            "stops, or the same attitudes again later, lower its share."
        )
    if len(d.noise) > len(d.found.noise):
        measured = d.consistency
        out.append(
            f"Correct the noise in the IMU's file: gyro times {measured.gyro.ratio:.2f}, "
            f"accelerometer times {measured.accel.ratio:.2f}; look for outliers when the tails are heavy."
        )
    return out


def _about_found(d: Diagnosis, found: tuple[Found, ...], plan: PlanSeen) -> list[str]:
    out: list[str] = []
    if d.verdict == Verdict.UNEXPLAINED:
        worst = d.consistency.where[0] if d.consistency.where else None
        place = f", worst at stop {worst.stop} in {worst.channel}" if worst else ""
        if d.found.noise:
            out.append(f"Something unknown acts{place}: the sigmas of the result take it in as scatter.")
        else:
            out.append(f"Do not use coefficients of this test beyond their scatter: something unknown acts{place}.")
        out.append(
            "Run the plan again in another order, and diagnose both recordings together (sdimu diagnose FIRST SECOND): "
            "that says whether it comes back at the same attitude, time or temperature, or is of this run. The other "
            "order: sdimu plan --plan YOURS --backwards."
        )
        if found:
            names = ", ".join(f.candidate.label for f in found)
            out.append(f"Try an equation of your own (--try FILE); nearest in this test: {names}.")
        return out
    out += keep([one for one in found if _belongs(one)])
    for one in found:
        label = one.candidate.label
        if one.candidate.family == references.LATITUDE.name:
            out.append(_about_latitude(one))
        elif one.candidate.effect.scope == "recording":
            out.append(f"{label} is a fault of this recording: record again and do not carry it over.")
    out += together([(one, separate(one, plan)) for one in found if one.alike])
    for one in found:
        out += [text] if one.alike and (text := _calculated(one)) else []
        if one.coefficient_shifts:
            out.append(_at_stake(one))
    return out


def keep(found: Sequence[Found]) -> list[str]:
    """Say in one line, which can be pasted, how what was found gets into the model; nothing for nothing."""
    if not found:
        return []
    what = found[0].candidate.label if len(found) == 1 else "what was found"
    return [f"Keep {what} in the model: {' '.join(f'--add {quoted(one.candidate.added)}' for one in found)}."]


def together(asked: Sequence[tuple[Found, str]]) -> list[str]:
    """Say what tells classes apart, one line for each thing to do.

    Parameters
    ----------
    asked : sequence of (Found, str)
        What was found, and what to do to tell it from what looks the same.
    """
    groups: dict[str, list[str]] = {}
    for one, what in asked:
        groups.setdefault(what, []).append(f"{one.candidate.label} from {', '.join(one.alike[:3])}")
    return [f"To tell {', and '.join(pairs)}: {what}." for what, pairs in groups.items()]


def _belongs(one: Found) -> bool:
    """Whether an effect belongs into the model of the sensor: no wrong site, no fault of one recording."""
    return one.candidate.family != references.LATITUDE.name and one.candidate.effect.scope != "recording"


def quoted(label: str) -> str:
    """Quote a label for a shell."""
    return f"'{label}'"


def _at_stake(one: Found) -> str:
    """Say which coefficients are right only if the named member of a class is the right one."""
    largest: dict[str, CoefficientShift] = {}
    for stake in sorted(one.coefficient_shifts, key=lambda s: -abs(s.sigmas)):
        largest.setdefault(stake.coefficient, stake)
    parts = [
        f"with {s.other} instead, {s.coefficient} moves by {s.sigmas:+.0f} of its sigmas"
        for s in list(largest.values())[:_MOST_STAKES]
    ]
    return f"Which it is matters: {one.candidate.label} is taken; {'; '.join(parts)}."


def _about_latitude(one: Found) -> str:
    """Send a wrong site back to its file: the effect is what the site's latitude has too much."""
    off, sigma = (np.degrees(v) for v in (one.value, one.sigma))
    sense = "North" if off > 0.0 else "South"
    return (
        f"Look at the site: its latitude is {abs(off):.2f} +- {sigma:.2f} deg too far {sense}; correct it there "
        "(--site) rather than add the effect."
    )


def separate(one: Found, plan: PlanSeen) -> str:
    """Name the next turn or stop that would tell a class apart, with minutes."""
    return telling_turn(one.candidate.effect, plan)


def telling_turn(effect: Effect, plan: PlanSeen) -> str:
    """Name the next turn or stop that would tell an effect from what looks the same, with minutes."""
    dwell = max(plan.dwell_minutes, 1.0)
    needed = effect.excitation
    if Excitation.TWO_RATES in needed and plan.one_rate():
        minutes = 2 * (dwell + 0.3)
        return f"add a turn of 180 deg and back about that axis, level, at 10 deg/s ({minutes:.0f} min)"
    if Excitation.BOTH_SENSES in needed and plan.one_sided():
        return f"add a turn of 180 deg about that axis in the other sense ({dwell + 1.5:.0f} min)"
    if Excitation.REPEATED_ATTITUDES in needed:
        return (
            f"stay at the last stop for {_SLOW_MINUTES:.0f} min more, then repeat the first stop "
            f"({dwell + 1.0:.0f} min)"
        )
    if Excitation.OBLIQUE_STOPS in needed:
        return (
            f"add two stops on the body diagonal, X +45 deg and Y -35.3 deg and back ({2 * (dwell + 0.6):.0f} min), "
            "or run the plan 'recommended'"
        )
    return f"repeat the turn that shows it in the other sense and at 10 deg/s ({2 * (dwell + 0.5):.0f} min)"


def _calculated(one: Found) -> str:
    """Name the command that ranks all turns by what they tell, where it knows both effects."""
    names = (one.candidate.label, one.alike[0])
    if not all(map(_in_catalogue, names)):
        return ""
    return f"Turns ranked by what they tell: sdimu plan --plan YOURS {' '.join(f'--tell {quoted(n)}' for n in names)}."


def _in_catalogue(name: str) -> bool:
    try:
        selection.resolve(name)
    except DataError:
        return False
    return True


def _about_plan(reached: tuple[DetectableSize, ...], plan: PlanSeen) -> list[str]:
    out = []
    hidden = [effect.excitation for r in reached if not r.testable and (effect := registry.find(r.family))]
    if any(Excitation.BOTH_SENSES in needed for needed in hidden) and plan.one_sided():
        out.append(
            f"{_capital(_senses(plan))}, so scale-factor asymmetry of the gyros cannot be seen: drive the second turn "
            "of each 180 deg pair negative (0 min more; the plan 'kim18_signed')."
        )
    if {Excitation.TWO_RATES} in hidden and plan.one_rate():
        out.append(
            f"{_capital(_rates(plan))}, so the shape of the scale factor cannot be seen: alternate 2 and 10 deg/s "
            "(shorter; the plan 'recommended')."
        )
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


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]
