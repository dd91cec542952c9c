"""The verdict of a diagnosis: a word that programs read, and a sentence for people."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.diagnosis.grades import (
    LISTED,
    Graded,
    each_grade,
    graded,
    in_grades,
    listed,
    other_coefficients,
)
from sdimu_calibration.core.error_figures import held_out, held_out_judged, noise_learned
from sdimu_calibration.core.estimation.noise_estimate import term_in_words
from sdimu_calibration.core.evidence.candidate import OF_RECORDING
from sdimu_calibration.core.evidence.consistency import SLOW_S, Consistency
from sdimu_calibration.core.handheld.run_scatter import FORCE, RATE, TURN
from sdimu_calibration.core.noise_term import DRAWN, FOLLOWS, NoiseTerm
from sdimu_calibration.core.posterior.posterior import PROBABLE
from sdimu_calibration.core.posterior.told import Probabilities
from sdimu_calibration.core.probability import in_percent
from sdimu_calibration.core.units import from_si
from sdimu_calibration.core.verdict import Verdict

if TYPE_CHECKING:
    from sdimu_calibration.core.diagnosis.diagnose import Diagnosis
    from sdimu_calibration.core.diagnosis.found import Found

POSSIBLE = 0.1
"""Probability (1) from which something that is not told is listed as possible: less is one of many."""
_COLOURED = 1.2
"""Ratio of the scatter over ten seconds to that of white noise from which noise is coloured: five sigma of fifty
minutes."""
_ROUNDING = 1e-6
"""Size of a learned sigma (customary unit) up to which it is written as zero: rounding leaves as much."""
_FITTED_BY = "Missing for certain, and fitted by"
"""What is said of equations in the place of ``Certain``."""

_ALONE = "No effect of the catalogue fits, an equation does."
_LEFT = "No effect of the catalogue fits what is left, an equation does."
"""`_ALONE`, `_LEFT`: what is said before equations, alone and behind effects."""
IF_NONE = "as noise, and may be too small if it is none"
"""What is said of sigmas that hold something unexplained."""
_FITTED = "In what was fitted, but not beyond it"
"""What is said in the place of ``Certain`` where what was found fails on data that no fit has seen."""


@dataclass(frozen=True)
class Facts:
    """What the verdict on a recording, or on a set of them, follows from."""

    effects: Sequence[tuple[str, tuple[str, ...]]] = ()
    """Labels of what was found of the unit, each with what the data cannot tell from it."""
    of_recording: int = 0
    """Number of faults of one recording that were found."""
    grave: bool = False
    """Whether the data have a fault that the screen sees."""
    unexplained: bool = False
    """Whether something speaks against a model that has what was found."""
    own: bool = False
    """What was found are own equations, not registered effects."""
    nothing: float = 1.0
    """Probability that nothing is missing."""
    noise: bool = False
    """Whether the noise is not as the IMU file states it."""


def verdict(facts: Facts) -> Verdict:
    """Give the verdict."""
    if facts.grave:
        return Verdict.DATA_FAULT
    if facts.unexplained:
        return Verdict.UNEXPLAINED
    if facts.own:
        return Verdict.OWN_EQUATION
    if len(facts.effects) > 1:
        return Verdict.SEVERAL_EFFECTS
    if facts.effects:
        open_which = other_coefficients(*facts.effects[0])
        return Verdict.CLASS_OF_EFFECTS if open_which else Verdict.ONE_EFFECT
    if facts.of_recording:
        return Verdict.DATA_FAULT
    if facts.nothing < PROBABLE:
        # Something is missing, and no class by itself is likely: together they are.
        return Verdict.CLASS_OF_EFFECTS
    return Verdict.NOISE_MODEL_WRONG if facts.noise else Verdict.CONSISTENT


def statements(d: Diagnosis, found: Sequence[Found], held: bool = True) -> tuple[str, ...]:
    """Say the verdict: what was found by how sure it is, a statement a grade, then what is left.

    Parameters
    ----------
    found : sequence of Found
        What was chosen, one at a time.
    held : bool
        Whether it holds where it was not fitted; False: nothing of it is called certain.
    """
    if d.verdict == Verdict.CONSISTENT:
        return (_consistent(d),)
    if d.verdict == Verdict.NOISE_MODEL_WRONG:
        nothing = nothing_missing(d.probabilities)
        return (f"The noise model is wrong, and no missing effect shows{nothing}: {'; '.join(d.noise)}.",)
    if d.verdict == Verdict.DATA_FAULT:
        grave = [f.text for f in d.findings if f.grave]
        return (f"The data have a fault: {'; '.join(grave)}." if grave else _of_recording(d, found),)
    every = _graded(d, [one for one in found if not _is_fault(one)])
    faults = tuple(text for text in (_of_recording(d, found),) if text)
    if d.verdict == Verdict.UNEXPLAINED:
        return _unexplained(d, (*each_kind(every, held, lead=False), *faults))
    if not d.chosen and d.probabilities is not None:
        return (something_missing(d.probabilities),)
    return (*each_kind(every, held), *faults)


def each_kind(every: Sequence[Graded], held: bool = True, lead: bool = True) -> tuple[str, ...]:
    """Say what was found, a statement a grade: effects of the catalogue, then equations that no physics names.

    That an equation fits does not say that it is the physics: others that were not tried may fit as well.

    Parameters
    ----------
    held : bool
        Whether it holds where it was not fitted; False: nothing of it is called certain.
    lead : bool
        Say before equations that no effect fits.
    """
    effects = each_grade([one for one in every if not one.is_equation], "Certain" if held else _FITTED)
    equations = each_grade([one for one in every if one.is_equation], _FITTED_BY if held else _FITTED)
    before = (_LEFT if effects else _ALONE,) if equations and lead else ()
    return (*effects, *before, *equations)


def _of_recording(d: Diagnosis, found: Sequence[Found]) -> str:
    """Say what is wrong with this recording alone; empty where nothing is."""
    faults = _graded(d, [one for one in found if _is_fault(one)])
    return f"The data have a fault in this recording. {in_grades(faults)}" if faults else ""


def _graded(d: Diagnosis, found: Sequence[Found]) -> tuple[Graded, ...]:
    return graded(sorted(found, key=lambda one: -one.log_likelihood_gain), d.probabilities)


def _is_fault(one: Found) -> bool:
    return one.candidate.effect.scope == "recording"


def nothing_missing(told: Probabilities | None) -> str:
    """Say how probable it is that nothing is missing, behind a statement; empty where no probabilities are known."""
    return f" (nothing is missing: {in_percent(told.nothing)})" if told else ""


def something_missing(told: Probabilities) -> str:
    """Say that something is missing where no effect by itself is probable: the likeliest, each with its probability."""
    members = sorted((one for f in told.families for one in f.members), key=lambda one: -one.probability)
    likely = ", ".join(f"{_in_words(one.label)} {in_percent(one.probability)}" for one in members[:LISTED])
    which = f"no effect by itself is likely: {likely}" if likely else "none of very many effects by itself is likely"
    return f"Something is missing ({in_percent(1.0 - told.nothing)}), but {which}."


def _in_words(label: str) -> str:
    """Write a label, that of one recording with its name in words."""
    key, _, recording = label.partition(OF_RECORDING)
    return f"{key} in {recording}" if recording else key


def _consistent(d: Diagnosis) -> str:
    if d.rungs and d.rungs[0].scatter is not None:
        left = beyond(d.rungs[0].scatter)
        return f"No effect of the catalogue stands out of the scatter of this run. Scatter beyond white noise: {left}."
    odd = "; ".join(f.text for f in d.findings)
    clean = f"The model explains the recording: nothing stands out of the noise{nothing_missing(d.probabilities)}"
    if d.found.noise:
        clean = (
            f"{clean}; noise has the memory that the IMU's file states: {', '.join(map(term_in_words, d.found.noise))}"
        )
    return f"{clean}; but {odd}." if odd else f"{clean}."


def _unexplained(d: Diagnosis, told: tuple[str, ...]) -> tuple[str, ...]:
    if d.rungs and d.rungs[-1].scatter is not None:
        most = f", {d.found.steps[0].label} most" if d.found.steps else ""
        left = beyond(d.rungs[-1].scatter)
        return (f"Something stands out of the scatter{most}. Scatter beyond white noise: {left}.",)
    names = listed(c.label for c in d.chosen)
    follows = [term_in_words(term) for term in d.found.noise if term.kind in FOLLOWS]
    drawn = [term_in_words(term) for term in d.found.noise if term.kind not in FOLLOWS]
    if follows:
        begun = "What is left is the" if names else "No effect of the catalogue explains the"
        # Noise that every sensor has is no part of what is unexplained.
        account = " and ".join(("it", *drawn))
        return (*(told if names else ()), f"{begun} {' and '.join(follows)}; the sigmas count {account} {IF_NONE}.")
    like_effects = any(term.kind in DRAWN for term in d.found.noise)
    may_be = "" if names or like_effects else _may_be(d.probabilities)
    if may_be:
        return (f"Something is missing, and which is open: {may_be}.",)
    if drawn:
        begun = "What is left" if names else "Something is missing that"
        looks = (
            f"{begun} looks like {' and '.join(drawn)}: a cause outside the catalogue, or a bias that does so; the "
            f"sigmas count it {IF_NONE}."
        )
        return (*(told if names else ()), looks)
    tail = f"; {names} would take {100 * d.explained:.0f} % of it" if names else ""
    error = held_out_judged(d.after)
    if names and error > 1.0:
        noise = " in the noise that was learned" if noise_learned(d.after) else ""
        tail += f", and the error at stops held out is then {error:.2f}{noise} (1 is right)"
    return (f"Something is missing that no effect of the catalogue explains{tail}{_coloured(d.consistency)}.",)


def _may_be(told: Probabilities | None) -> str:
    """List effects, and noise that stands for one, that may be missing, the likeliest first.

    Empty where it is more likely that none of them is.
    """
    if told is None:
        return ""
    shares = [(one.probability, _in_words(one.label)) for f in told.families for one in f.members]
    like = [one for one in told.noise if one.kind in DRAWN]
    if 1.0 - told.nothing + sum(one.probability for one in like) < PROBABLE:
        return ""
    shares += [(one.probability, NoiseTerm(one.triad, one.kind, axes=one.axes).words) for one in like]
    likely = sorted((one for one in shares if one[0] >= POSSIBLE), key=lambda one: -one[0])[:LISTED]
    return ", ".join(f"{words} {in_percent(p)}" for p, words in likely)


def error_falls(d: Diagnosis) -> str:
    """Say how far the error falls with what was found."""
    if d.rungs and d.rungs[0].scatter is not None and d.rungs[-1].scatter is not None:
        first, last = d.rungs[0], d.rungs[-1]
        return (
            f"error at rests held out: {first.held_out_rms:.3f} -> {last.held_out_rms:.3f}; beyond white noise: "
            f"{beyond(d.rungs[0].scatter)} -> {beyond(d.rungs[-1].scatter)}"
        )
    white = ", in white noise" if noise_learned(d.after) else ""
    return f"error at stops held out{white}: {held_out(d.before):.3f} -> {held_out(d.after):.3f}"


def beyond(scatter: Sequence[float] | Floats) -> str:
    """Say what is left beyond white noise.

    Parameters
    ----------
    scatter : ndarray, shape (3,), or sequence of float
        Learned sigmas of force (m/s^2), rate (rad/s) and turns (share of the angle), at the places `FORCE`, `RATE` and
        `TURN`.
    """
    force, rate = from_si(float(scatter[FORCE]), "ug"), float(np.degrees(scatter[RATE]))
    turns = 100.0 * float(scatter[TURN])
    return f"force {shown(force)} ug, rate {shown(rate)} deg/s, turns {shown(turns)} % of the angle"


def shown(value: float) -> str:
    """Write a learned sigma in its customary unit; zero when only rounding made it."""
    return f"{value:.3g}" if value > _ROUNDING else "0"


def _coloured(consistency: Consistency) -> str:
    """Say whose noise is not white: it passes for drifts that no effect has."""
    told = [
        f"{triad} scatters {noise.slow:.1f} times more over {SLOW_S} s than white noise of its seconds would"
        for triad, noise in (("gyro", consistency.gyro), ("accel", consistency.accel))
        if noise.slow > _COLOURED
    ]
    return f"; coloured noise would explain it: {' and '.join(told)}" if told else ""
