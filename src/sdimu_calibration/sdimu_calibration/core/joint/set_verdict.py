"""The verdict on a set of recordings: a word that programs read, and a sentence for people."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from sdimu_calibration.core.diagnosis.alarms import STILL_WRONG
from sdimu_calibration.core.diagnosis.found import DECIDED
from sdimu_calibration.core.diagnosis.grades import LISTED, NAMED, Graded, named, size, without_variant
from sdimu_calibration.core.diagnosis.verdict import (
    IF_NONE,
    Facts,
    each_kind,
    nothing_missing,
    something_missing,
    verdict,
)
from sdimu_calibration.core.joint.changed import is_change
from sdimu_calibration.core.joint.recurrence import Recurrence
from sdimu_calibration.core.joint.recurrence_words import answer_in_words
from sdimu_calibration.core.joint.scope import tagged
from sdimu_calibration.core.joint.set_evidence import held_out_chance
from sdimu_calibration.core.joint.set_fit import SetFit
from sdimu_calibration.core.joint.set_found import FunctionShare
from sdimu_calibration.core.joint.set_result import MANY, SCATTERS
from sdimu_calibration.core.noise_term import NoiseTerm
from sdimu_calibration.core.note import Topic, topic_of, without_advice
from sdimu_calibration.core.plain_text import first_of, listing
from sdimu_calibration.core.posterior.told import Probabilities, Share
from sdimu_calibration.core.probability import in_percent
from sdimu_calibration.core.results import Calibration
from sdimu_calibration.core.verdict import Verdict


@dataclass(frozen=True)
class SetFinding:
    """An effect that was found."""

    label: str
    recording: str
    """The only one that shows it; empty where all do."""
    value: float
    sigma: float
    """`value`, `sigma`: SI, of the joint fit with everything that was found."""
    z: float
    """Score beside what was found before it."""
    unit: str
    display_unit: str
    alike: tuple[str, ...]
    """What the set cannot tell from it."""
    probability: float = float("nan")
    """That it or one of these is in all recordings, or in this one."""
    may_be: tuple[Share, ...] = ()
    """Coefficients of that class with the probability of each, the likeliest first."""
    against: str = ""
    """The other one of two recordings, where a coefficient is not the same in both: no data tell which of them changed.
    Empty for all else."""
    family: str = ""
    """Of the effect, without axis and variant."""

    @property
    def decided(self) -> bool:
        """Whether it is sure that it is missing, and not something else of its class."""
        return self.probability >= DECIDED and not _graded(self).is_open

    @property
    def tag(self) -> str:
        """Label, of one recording with its name behind."""
        return tagged(self.label, self.recording) if self.recording else self.label


@dataclass(frozen=True)
class SetFacts:
    """What the verdict on a set follows from."""

    findings: Sequence[SetFinding]
    after: Calibration
    """With what was found."""
    fit: SetFit
    """The same, as it was estimated."""
    again: Recurrence | None
    """What comes back of that what the model leaves in the stops; None where it leaves nothing."""
    told: Probabilities | None
    """None where the search did not come to an end."""

    functions: Sequence[FunctionShare] = ()
    """Likely functions of the attitude, of all recordings or of one."""
    drawn: Mapping[str, tuple[NoiseTerm, ...]] = field(default_factory=dict)
    """Noise that no sensor has by itself, nearly certain, by the recording."""

    @property
    def own(self) -> bool:
        """Whether an equation that no physics names was found."""
        return any(f.family == "own" for f in self.findings)

    @property
    def beside_function(self) -> bool:
        """Whether an unknown function of the attitude, the same in all recordings, explains what is left."""
        return any(one.is_common for one in self.functions)

    @property
    def is_of_each(self) -> bool:
        """Whether functions of single recordings explain what is left, and it does not come back."""
        return bool(self.functions) and not self.beside_function and not self.comes_back

    @property
    def comes_back(self) -> bool:
        """Whether what is left comes back: it is no noise then, whatever each recording took it for."""
        return self.again is not None and len(self.again.answer) > 0


def verdict_of_set(facts: SetFacts) -> Verdict:
    """Give the verdict."""
    findings, error = facts.findings, facts.after.fit["held_out_rms"]
    shared = [(f.label, f.alike) for f in findings if not f.recording]
    still = error is not None and error > STILL_WRONG and held_out_chance(facts.fit, error) < SCATTERS
    left = _scatter(facts.after) < SCATTERS or still or facts.comes_back
    # A fault leaves traces in its recording that are no physics of the unit.
    unlike = {*facts.drawn, *(one.recording for one in facts.functions)} - {
        f.recording for f in findings if f.recording
    }
    unexplained = bool(unlike) or (left and (bool(shared) or not findings))
    # A search that came to no end says that something is missing.
    unexplained |= not findings and facts.told is None
    nothing = 1.0 if facts.told is None else facts.told.nothing
    faults = len(findings) - len(shared)
    return verdict(Facts(shared, faults, unexplained=unexplained, own=facts.own, nothing=nothing))


def _scatter(result: Calibration) -> float:
    """Probability that the scatter of coefficients from recording to recording is chance, all counted."""
    if result.of_set is None:
        return 1.0
    seen = result.of_set.scatter_p[np.isfinite(result.of_set.scatter_p)]
    return float(min(1.0, len(seen) * seen.min())) if len(seen) else 1.0


def statements(word: Verdict, facts: SetFacts) -> tuple[str, ...]:
    """Say what was found, a statement a grade, then what each recording has, and what comes back."""
    again = facts.again
    # Beside functions that explain what is left, stops that do not come back are too few, and say nothing.
    tells = again is not None and (not facts.functions or facts.comes_back)
    more = (answer_in_words(again, word == Verdict.UNEXPLAINED),) if again is not None and tells else ()
    return (*_found(word, facts), *more)


def _found(word: Verdict, facts: SetFacts) -> tuple[str, ...]:
    findings, told = facts.findings, facts.told
    if word == Verdict.CLASS_OF_EFFECTS and not findings and told is not None:
        return (something_missing(told),)
    if word == Verdict.CONSISTENT:
        how = "nothing stands out of the noise" if facts.again is None else "each in a noise of its own"
        mark = ":" if facts.again is None else ","
        return (f"The model explains all recordings together{mark} {how}{nothing_missing(told)}.",)
    if word == Verdict.DATA_FAULT:
        return (_of_recordings(findings), *_of_each(facts))
    every = list(map(_graded, findings))
    if word == Verdict.UNEXPLAINED:
        odd = () if facts.beside_function else _odd(facts.after)
        shared = facts.beside_function or (facts.comes_back and not odd)
        what = "The recordings share something" if shared else "Something differs between the recordings"
        beside = ("Found beside it:", *each_kind(every, lead=False)) if every else ()
        return (f"{what} that no effect of the catalogue explains.", *beside, *odd, *_of_each(facts))
    return each_kind(every)


def _of_recordings(findings: Sequence[SetFinding]) -> str:
    """Say what single recordings have, where nothing of the unit is missing."""
    changed = [f for f in findings if f.against or is_change(f.label)]
    if len(changed) > MANY:
        return _many_changed(changed)
    return f"All recordings agree but for {_some([_named(f) for f in findings])}."


def _of_each(facts: SetFacts) -> tuple[str, ...]:
    """Say what recordings have each for itself: a function of the attitude, or noise that no sensor has by itself."""
    own = [one for one in facts.functions if not one.is_common]
    alone = [f"{one.recording} ({_how(one, facts.told is not None)})" for one in own]
    words: dict[str, list[str]] = {}
    for name, terms in facts.drawn.items():
        for term in terms:
            words.setdefault(term.words, []).append(name)
    drawn = [f"{what} in {_some(names)}" for what, names in words.items()]
    each = ", another one in each," if len(alone) > 1 else ""
    told = [f"An error that follows the attitude{each} is in {_some(alone)}."] if alone else []
    return (*told, *([f"What is left looks like {_some(drawn)}; the sigmas count it {IF_NONE}."] if drawn else []))


def _how(one: FunctionShare, weighed: bool) -> str:
    """Name the sensors of a function, and say how likely it is where the search came to an end."""
    return ", ".join((*one.sensors, *((in_percent(one.probability),) if weighed else ())))


def _some(names: Sequence[str]) -> str:
    """Name some, and how many more there are."""
    return listing(names) if len(names) <= LISTED else f"{', '.join(names[:LISTED])} and {len(names) - LISTED} more"


def _graded(f: SetFinding) -> Graded:
    # Of what is of one recording alone the class is not told: what happened there is to be found out.
    shares = () if f.recording else tuple(share for share in f.may_be if share.probability >= NAMED)
    words, size_, own = _named(f), size(f.value, f.sigma, f.display_unit), f.family == "own"
    return Graded(words, without_variant(f.label), size_, f.probability, shares, is_equation=own)


def _many_changed(changed: Sequence[SetFinding]) -> str:
    """Say that so many coefficients are others in some recordings that physics is not what changed them."""
    which = dict.fromkeys(name for f in changed for name in (f.against, f.recording) if name)
    most = first_of([f.label for f in changed], LISTED)
    where = f"{' and '.join(which)} differ" if changed[0].against else f"in {' and '.join(which)}, the unit differs"
    return (
        f"Not one unit, or one that was changed, or axes or units that are read otherwise: {where} in {len(changed)} "
        f"coefficients ({most})."
    )


def _named(f: SetFinding) -> str:
    if f.against:
        return (
            f"{named(f.label)}, which differs by {size(f.value, f.sigma, f.display_unit)} from {f.against} to "
            f"{f.recording} (two recordings do not tell which of them changed)"
        )
    if f.recording and is_change(f.label):
        return f"{named(f.label)} changed by {size(f.value, f.sigma, f.display_unit)} in {f.recording}"
    where = f" in {f.recording} alone" if f.recording else ""
    return f"{named(f.label)} ({size(f.value, f.sigma, f.display_unit)}){where}"


def _odd(result: Calibration) -> tuple[str, ...]:
    lines = without_advice(line for line in result.warnings if topic_of(line) == Topic.DIFFERS)
    return tuple(f"{line}." for line in lines[:1])
