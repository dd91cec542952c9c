"""The verdict on a set of recordings: a word that programs read, and a sentence for people."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sdimu_calibration.core.diagnosis.alarms import STILL_WRONG
from sdimu_calibration.core.diagnosis.found import DECIDED
from sdimu_calibration.core.diagnosis.grades import LISTED, NAMED, Graded, in_grades, named, size, without_variant
from sdimu_calibration.core.diagnosis.verdict import Facts, nothing_missing, something_missing, verdict
from sdimu_calibration.core.estimation.navigation_fit import MISFIT
from sdimu_calibration.core.joint.changed import is_change
from sdimu_calibration.core.joint.recurrence import Recurrence
from sdimu_calibration.core.joint.recurrence_words import answer_in_words
from sdimu_calibration.core.joint.scope import tagged
from sdimu_calibration.core.joint.set_evidence import held_out_chance
from sdimu_calibration.core.joint.set_fit import SetFit
from sdimu_calibration.core.joint.set_result import MANY, SCATTERS, worst_figure
from sdimu_calibration.core.noise_term import may_be_an_effect
from sdimu_calibration.core.note import Topic, topic_of, without_advice
from sdimu_calibration.core.plain_text import first_of
from sdimu_calibration.core.posterior.told import Probabilities, Share
from sdimu_calibration.core.results import Calibration
from sdimu_calibration.core.verdict import Verdict


@dataclass(frozen=True)
class SetFinding:
    """An effect that was found."""

    label: str
    title: str
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

    @property
    def beside_function(self) -> bool:
        """Whether an unknown function of the attitude explains what is left."""
        return self.fit.function is not None

    @property
    def is_of_some(self) -> bool:
        """Whether some recordings have large errors that noise takes in, and others small ones and no noise.

        A recording of one stop does not count: nothing that changes with attitude or rate changes in it.
        """
        reports = [r for r in self.fit.reports if len(r.times.stops) > 1]
        loud = [r.noise for r in reports if worst_figure(r) > MISFIT]
        quiet = [r.noise for r in reports if worst_figure(r) <= MISFIT]
        return any(map(may_be_an_effect, loud)) and any(not noise for noise in quiet)

    @property
    def comes_back(self) -> bool:
        """Whether what is left comes back: it is no noise then, whatever each recording took it for."""
        return self.again is not None and len(self.again.answer) > 0


def verdict_of_set(facts: SetFacts) -> Verdict:
    """Give the verdict."""
    findings, error = facts.findings, facts.after.fit["held_out_rms"]
    shared = [(f.label, f.alike) for f in findings if not f.recording]
    still = error is not None and error > STILL_WRONG and held_out_chance(facts.fit, error) < SCATTERS
    left = _scatter(facts.after) < SCATTERS or still or facts.comes_back or facts.is_of_some
    # A fault leaves traces in its recording that are no physics of the unit.
    unexplained = facts.beside_function or (left and (bool(shared) or not findings))
    # A search that came to no end says that something is missing.
    unexplained |= not findings and facts.told is None
    nothing = 1.0 if facts.told is None else facts.told.nothing
    return verdict(Facts(shared, len(findings) - len(shared), unexplained=unexplained, nothing=nothing))


def _scatter(result: Calibration) -> float:
    """Probability that the scatter of coefficients from recording to recording is chance, all counted."""
    if result.of_set is None:
        return 1.0
    seen = result.of_set.scatter_p[np.isfinite(result.of_set.scatter_p)]
    return float(min(1.0, len(seen) * seen.min())) if len(seen) else 1.0


def sentence(word: Verdict, facts: SetFacts) -> str:
    """Say what was found, then what comes back of that what the model leaves."""
    again = facts.again
    # Beside a function that explains what is left, stops that do not come back are too few, and say nothing.
    tells = again is not None and (not facts.beside_function or facts.comes_back)
    more = answer_in_words(again, word == Verdict.UNEXPLAINED) if again is not None and tells else ""
    return f"{_found(word, facts)} {more}".strip()


def _found(word: Verdict, facts: SetFacts) -> str:
    findings, told = facts.findings, facts.told
    if word == Verdict.CLASS_OF_EFFECTS and not findings and told is not None:
        return something_missing(told)
    if word == Verdict.CONSISTENT:
        how = "nothing stands out of the noise" if facts.again is None else "each in a noise of its own"
        mark = ":" if facts.again is None else ","
        return f"The model explains all recordings together{mark} {how}{nothing_missing(told)}."
    if word in {Verdict.DATA_FAULT, Verdict.UNEXPLAINED}:
        names = " and ".join(map(_named, findings[:LISTED]))
        names += f" and {len(findings) - LISTED} more" if len(findings) > LISTED else ""
        changed = [f for f in findings if f.against or is_change(f.label)]
        if word == Verdict.DATA_FAULT and len(changed) > MANY:
            return _many_changed(changed)
        if word == Verdict.DATA_FAULT:
            return f"All recordings agree but for {names}."
        most = f" Found beside it: {in_grades(list(map(_graded, findings)))}" if findings else ""
        odd = "" if facts.beside_function else _odd(facts.after)
        shared = facts.beside_function or (facts.comes_back and not odd)
        what = "The recordings share something" if shared else "Something differs between the recordings"
        return f"{what} that no effect of the catalogue explains.{most}{odd}"
    return in_grades(list(map(_graded, findings)))


def _graded(f: SetFinding) -> Graded:
    # Of what is of one recording alone the class is not told: what happened there is to be found out.
    shares = () if f.recording else tuple(share for share in f.may_be if share.probability >= NAMED)
    return Graded(_named(f), without_variant(f.label), size(f.value, f.sigma, f.display_unit), f.probability, shares)


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


def _odd(result: Calibration) -> str:
    lines = without_advice(line for line in result.warnings if topic_of(line) == Topic.DIFFERS)
    return f" {lines[0]}." if lines else ""
