"""Advice in words, as files, pages and Python give it, with the commands of a shell in their general form."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from sdimu_calibration.core.advice import Advice, Kind, Verb
from sdimu_calibration.core.plain_text import capital

EXCLUDE = "--exclude-times"
"""Option that leaves times out."""


@dataclass(frozen=True)
class Speech:
    """How users start what an advice means: in a shell or in Python."""

    command: Callable[[Advice], str]
    """Writes the command of an advice."""
    together: str
    """Diagnose several recordings as one unit."""
    alone: str
    """Diagnose one recording."""
    attempt: str
    """Try an effect of one's own."""
    site: str
    """State the site."""
    backwards: str
    """Put the plan into another order."""


def sentence(advice: Advice, speech: Speech | None = None) -> str:
    """Return an advice as one sentence, its command included; `speech`: that of a shell where it is left out."""
    said = speech or SHELL
    command = said.command(advice)
    if not command:
        return lead(advice, said)
    return f"{lead(advice, said)}: {command}."


def lead(advice: Advice, speech: Speech | None = None) -> str:
    """Return the words of an advice, without the command at their end; `speech`: as of `sentence`."""
    if advice.kind in _SPOKEN:
        return _SPOKEN[advice.kind](speech or SHELL, *advice.arguments)
    return _WORDS[advice.kind](*advice.arguments)


def general_command(advice: Advice) -> str:
    """Return the command that an advice means, with capitals for what is not known of the recording; empty for none."""
    if advice.verb is None:
        return ""
    if advice.verb == Verb.ADD:
        return added(advice)
    if advice.verb == Verb.DIAGNOSE:
        return f"sdimu diagnose {' '.join(advice.about) or 'BAG'}"
    if advice.verb == Verb.CONTINUE:
        return "sdimu plan --after"
    if advice.verb == Verb.LEAVE_OUT:
        return f"{EXCLUDE} {advice.about[0]}"
    if advice.verb == Verb.CUT:
        end, begin = advice.about
        return f"sdimu bag cut BAG --to {end} --out FIRST; sdimu bag cut BAG --from {begin} --out SECOND"
    return f"sdimu plan --plan PLAN {plan_options(advice)} ({PLAN_IS})"


PLAN_IS = "PLAN: name in config/plan, or file, of the plan that the table ran"
"""What stands for a plan in a command, where nothing of the recording names it."""
SHELL = Speech(
    general_command,
    "sdimu diagnose FIRST SECOND",
    "sdimu diagnose BAG",
    "sdimu diagnose BAG --try FILE",
    "--site",
    f"sdimu plan --plan PLAN --backwards; {PLAN_IS}",
)


def added(advice: Advice) -> str:
    """Return the options that add what an advice is about."""
    return " ".join(f"--add {_quoted(key)}" for key in advice.about)


def plan_options(advice: Advice) -> str:
    """Return what the planner is asked for, besides the plan."""
    if advice.verb == Verb.REVERSE_PLAN:
        return "--backwards"
    return " ".join(f"--tell {_quoted(label)}" for label in advice.about)


def _quoted(label: str) -> str:
    return f"'{label}'"


def _unknown(stop: int | None, channel: str, learned: bool) -> str:
    place = "" if stop is None else f", worst at stop {stop} in {channel}"
    if learned:
        return f"Something unknown acts{place}: the sigmas of the result take it in as scatter."
    return f"Something unknown acts{place}: coefficients of this test are no better than their scatter."


def _latitude(said: Speech, off: float, sigma: float) -> str:
    off_deg, sigma_deg = (math.degrees(v) for v in (off, sigma))
    sense = "North" if off_deg > 0.0 else "South"
    return (
        f"Look at the site: its latitude is {abs(off_deg):.2f} +- {sigma_deg:.2f} deg too far {sense}; correct it "
        f"there ({said.site}) rather than add the effect."
    )


def _apart(pairs: Sequence[tuple[str, Sequence[str]]], what: Advice) -> str:
    told = ", and ".join(f"{label} from {', '.join(_names(others))}" for label, others in pairs)
    return f"To tell {told}: {sentence(what)}."


def _names(labels: Sequence[str]) -> list[str]:
    """Return each coefficient once, without its time constants: what tells it from others tells each of them."""
    heads = (label.partition("(")[0] for label in labels)
    # The brackets of an equation, or those of another recording's name, are no time constant.
    names = (head if head.isidentifier() else label for head, label in zip(heads, labels, strict=True))
    return list(dict.fromkeys(names))


def _matters(label: str, stakes: Sequence[tuple[str, str, float]]) -> str:
    parts = [f"with {other} instead, {name} moves by {sigmas:+.0f} of its sigmas" for other, name, sigmas in stakes]
    return f"Which it is matters: {label} is taken; {'; '.join(parts)}."


def _keep(label: str) -> str:
    # Of an equation that no registered effect is, the data say how it looks, and not what else its cause does.
    known = ", if you know that it is the cause: the sigmas then take that for granted" if ": " in label else ""
    return f"Calibrate with {label} in the model{known}"


_WORDS: dict[Kind, Callable[..., str]] = {
    Kind.MEND_RECORDING: lambda text: f"Mend the recording first: {text}.",
    Kind.PART_RECORDING: lambda text: (
        f"Mend the recording first: {text}. Part it at that gap, and calibrate both parts as two recordings"
    ),
    Kind.LEAVE_OUT_TIMES: lambda text: f"Mend the recording first: {text}. Without that time",
    Kind.LOOK_FIRST: lambda text: f"Look at this first: {text}.",
    Kind.REPEAT_STOPS: lambda: (
        "The noise has a memory, which no compensation removes; values and sigmas are those in it. More "
        "stops, or the same attitudes again later, lower its share."
    ),
    Kind.OTHER_GRADE: lambda text: f"Look at the IMU's file first: {text}.",
    Kind.CORRECT_NOISE: lambda gyro, accel: (
        f"Correct the noise in the IMU's file: gyro times {gyro:.3g}, accelerometer times {accel:.3g}; look for "
        "outliers when the tails are heavy."
    ),
    Kind.UNKNOWN_CAUSE: _unknown,
    Kind.KEEP: lambda label: _keep(label or "what was found"),
    Kind.TRY: lambda label: (
        f"It is open which effect it is: record more before {label} goes into the model. Afterwards, if it is that one"
        if label
        else "It is open which these are. Record more before they go into the model. Afterwards, those that stay"
    ),
    Kind.RECORD_AGAIN: lambda label: f"{label} is a fault of this recording: record again and do not carry it over.",
    Kind.TELL_APART: _apart,
    Kind.RANK_TURNS: lambda: "Turns ranked by what they tell",
    Kind.CHOICE_MATTERS: _matters,
    Kind.CHOICE_MATTERS_HANDHELD: lambda label, other, name, sigmas: (
        f"Which it is matters: with {other} instead of {label}, {name} moves by {sigmas:+.0f} of its sigmas."
    ),
    Kind.SIGNED_TURNS: lambda seen: (
        f"{capital(seen)}, so scale-factor asymmetry of the gyros cannot be seen: drive the second turn "
        "of each 180 deg pair negative (0 min more; the plan 'kim18_signed')."
    ),
    Kind.TWO_RATES: lambda seen: (
        f"{capital(seen)}, so the shape of the scale factor cannot be seen: alternate 2 and 10 deg/s "
        "(shorter; the plan 'recommended')."
    ),
    Kind.STAY_AND_RETURN: lambda stay, again: (
        f"stay at the last stop for {stay:.0f} min more, then repeat the first stop ({stay + again:.0f} min together)"
    ),
    Kind.REPEAT_TURN: lambda minutes: (
        f"repeat the turn that shows it in the other sense and at 10 deg/s ({minutes:.0f} min)"
    ),
    Kind.COME_BACK: lambda: "come back to the first attitudes at the end, and rest there",
    Kind.TURN_BOTH_WAYS: lambda: "turn about that axis both ways, slowly and fast",
    Kind.REST_BETWEEN: lambda: "rest in more attitudes between the axes, both ends of that axis up",
    Kind.BEGIN_LATER: lambda: (
        "What comes back at the same time ends when the unit is warm: begin the plan later, or make the first stop "
        "longer."
    ),
    Kind.SOAK_MORE: lambda: (
        "Soaks tell what comes back at the same temperature: record at more temperatures, each held constant."
    ),
    Kind.LOOK_AT_MOUNT: lambda: (
        "What does not come back belongs to each run: check mount, cables and floor; until then count it as scatter."
    ),
    Kind.LOOK_AT_RECORDING: lambda recording, label: (
        f"Find out what happened in {recording}, which alone shows {label}, or leave it out of the set."
    ),
    Kind.LOOK_AT_SITE: lambda recording, share: (
        f"Check the site of {recording}: the scale factors of its three accelerometers differ alike, by {share}, as "
        "gravity at another latitude or height makes them."
    ),
    Kind.RECORD_A_THIRD: lambda label, one, other: (
        f"Record once more: a third recording tells which of {one} and {other} changed ({label})."
    ),
    Kind.NO_PLAN_TELLS: lambda label, other: (
        f"No plan tells {label} from {other}: record at another temperature, or after another warm-up."
    ),
    Kind.RECORD_ONCE_MORE: lambda label, others, rest, turns: (
        f"To tell {label} from {', '.join(others)}, record once more: rests of {rest:.0f} s, and between them {turns}."
    ),
    Kind.NO_TURN_TELLS: lambda label, others, best, tells: (
        f"No single turn tells {label} from {', '.join(others)} (the best one reaches {best:.1f} sigma, {tells:.0f} "
        "are needed)."
    ),
    Kind.PLAN_NEXT: lambda: "A whole plan of the next recording, for all that is open",
    Kind.FIND_EFFECT: lambda: "Find which effect is missing",
    Kind.FIND_SMALLER: lambda: "Find out whether smaller effects are missing",
}

_SPOKEN: dict[Kind, Callable[..., str]] = {
    Kind.RECORD_MORE: lambda said: (
        "One recording more lets one of the effects stand out, or all fall: record the unit again, and diagnose all "
        f"recordings together ({said.together})."
    ),
    Kind.RUN_BACKWARDS: lambda said: (
        f"Run the plan again in another order, and diagnose both recordings together ({said.together}): "
        "that says whether it comes back at the same attitude, time or temperature, or is of this run. The other order"
    ),
    Kind.RECORD_IN_OTHER_ORDER: lambda said: (
        f"Record the run again in another order, and diagnose both recordings together ({said.together}): "
        "that says whether it comes back at the same attitude, time or temperature, or is of this run."
    ),
    Kind.TRY_EQUATION: lambda said, *labels: (
        f"Try an equation of your own ({said.attempt}); nearest in this test: {', '.join(labels)}."
    ),
    Kind.CORRECT_LATITUDE: _latitude,
    Kind.REVERSE_AND_ADD: lambda said: (
        f"Record the plan in another order ({said.backwards}), and diagnose it with these."
    ),
    Kind.TRY_FORCE_EQUATION: lambda said: (
        "What comes back at the same attitude is an error of the sensor that the catalogue lacks: try an equation of "
        f"the specific force ({said.attempt})."
    ),
    Kind.ONE_BY_ONE: lambda said: (
        f"Diagnose the recordings one by one ({said.alone}), the one with the largest deviates first."
    ),
}
"""Words that name a command within; the first argument says how."""
