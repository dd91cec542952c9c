"""The verdict of a diagnosis: a word that programs read, and a sentence for people."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.diagnosis.screen import Finding
from sdimu_calibration.core.diagnosis.search import Search
from sdimu_calibration.core.error_figures import held_out, held_out_judged, noise_learned
from sdimu_calibration.core.estimation.noise_estimate import term_in_words
from sdimu_calibration.core.evidence.candidate import Candidate
from sdimu_calibration.core.evidence.consistency import SLOW_S, Consistency
from sdimu_calibration.core.evidence.linear import LinearEvidence
from sdimu_calibration.core.handheld.handheld_fit import FORCE, RATE, TURN
from sdimu_calibration.core.noise_term import FOLLOWS
from sdimu_calibration.core.posterior.posterior import PROBABLE
from sdimu_calibration.core.probability import in_percent
from sdimu_calibration.core.units import from_si
from sdimu_calibration.core.verdict import Verdict

if TYPE_CHECKING:
    from sdimu_calibration.core.diagnosis.diagnose import Diagnosis

_COLOURED = 1.2
"""Ratio of the scatter over ten seconds to that of white noise from which noise is coloured: five sigma of fifty
minutes."""
_ROUNDING = 1e-6
"""Size of a learned sigma (customary unit) up to which it is written as zero: rounding leaves as much."""
_LARGEST = 3
"""Number of effects that a sentence names where there are more than it lists: the table has the rest."""
CERTAIN = 0.99
"""Probability (1) from which an effect is called certain: one in a hundred is wrong then."""
_LISTED = 4
"""Number of effects, or of those that look the same as one, that a sentence lists: more do not fit into one."""


@dataclass(frozen=True)
class Facts:
    """What the verdict follows from.

    Attributes
    ----------
    alike : tuple of str
        What the data cannot tell from the first of them.
    """

    found: Search[LinearEvidence]
    chosen: tuple[Candidate, ...]
    alike: tuple[str, ...]
    findings: tuple[Finding, ...]
    noise: tuple[str, ...]
    own: bool
    unexplained: bool


def verdict(facts: Facts) -> Verdict:
    """Give the verdict."""
    chosen = facts.chosen
    if any(f.grave for f in facts.findings):
        return Verdict.DATA_FAULT
    if facts.unexplained:
        return Verdict.UNEXPLAINED
    if chosen:
        if facts.own:
            return Verdict.OWN_EQUATION
        if len(chosen) > 1:
            return Verdict.SEVERAL_EFFECTS
        if chosen[0].effect.scope == "recording":
            return Verdict.DATA_FAULT
        return Verdict.CLASS_OF_EFFECTS if facts.alike else Verdict.ONE_EFFECT
    if facts.noise:
        return Verdict.NOISE_MODEL_WRONG
    return Verdict.CONSISTENT


def sentence(d: Diagnosis) -> str:
    """Put the verdict into one sentence."""
    names = _named(d)
    if d.verdict == Verdict.CONSISTENT:
        return _consistent(d)
    if d.verdict == Verdict.NOISE_MODEL_WRONG:
        nothing = f" (nothing is missing: {in_percent(d.probabilities.nothing)})" if d.probabilities else ""
        return f"The noise model is wrong, the physics is not{nothing}: {'; '.join(d.noise)}."
    if d.verdict == Verdict.DATA_FAULT:
        faults = [f.text for f in d.findings if f.grave] or [f"{names} (a fault of this recording)"]
        return f"The data have a fault: {'; '.join(faults)}."
    if d.verdict == Verdict.UNEXPLAINED:
        return _unexplained(d, names)
    rest = error_falls(d)
    sure = _sure(d)
    if d.verdict == Verdict.OWN_EQUATION:
        return f"Something is missing that is not in the catalogue{sure}; it follows {names}; {rest}."
    if d.verdict == Verdict.CLASS_OF_EFFECTS:
        return f"One effect is missing{sure}: {names}, or what looks the same here ({_others(d)}); {rest}."
    if len(d.chosen) > 1 and len(_families(d)) == 1:
        return f"One effect is missing on {len(d.chosen)} axes{sure}: {names}; {rest}."
    if d.verdict == Verdict.ONE_EFFECT:
        return f"One effect is missing{sure}: {names}; {rest}."
    return f"Several effects are missing{_graded(d) or f'{sure}: {names}'}; {rest}."


def _sure(d: Diagnosis) -> str:
    """Say how probable what was found is; of several the least."""
    told = [d.may_be(int(column))[0] for column in d.found.chosen]
    if not told or not np.isfinite(min(told)):
        return ""
    return f" ({in_percent(min(told))})" if len(told) == 1 else f" (the least sure of them {in_percent(min(told))})"


def _graded(d: Diagnosis) -> str:
    """Name what is certain, and what is likely or open with its probability; empty where all is certain, or unknown."""
    p = {c.label: d.may_be(int(column))[0] for c, column in zip(d.chosen, d.found.chosen, strict=True)}
    families = _families(d)
    every = [c for group in families for c in group]
    others = {c.label: _others(d, list(d.chosen).index(c)) if d.is_open(c) else "" for c in every}
    firm = [[c for c in group if p[c.label] >= CERTAIN and not others[c.label]] for group in families]
    firm = [group for group in firm if group]
    if not all(np.isfinite(value) for value in p.values()) or sum(map(len, firm)) == len(every):
        return ""
    together = {label: "" if share >= CERTAIN else f"together {in_percent(share)}, " for label, share in p.items()}
    open_ = [
        f"{c.label} or what looks the same ({together[c.label]}{others[c.label]})" for c in every if others[c.label]
    ]
    likely = [f"{c.label} ({in_percent(p[c.label])})" for c in every if p[c.label] < CERTAIN and not others[c.label]]
    told = [f"certain {_in_words(firm)}"] if firm else []
    told += [f"likely {' and '.join(likely[:_LISTED])}"] if likely else []
    told += [f"open {' and '.join(open_[:_LISTED])}"] if open_ else []
    return f": {', '.join(told)}"


def _others(d: Diagnosis, place: int = 0) -> str:
    """Name what looks like an effect that was found, each with its probability."""
    own = d.chosen[place].parameter.name
    _, shares = d.may_be(int(d.found.chosen[place]))
    told = [f"{share.name} {in_percent(share.probability)}" for share in shares if share.name != own]
    return ", ".join((told or (list(d.alike) if place == 0 else []))[:_LISTED])


def _families(d: Diagnosis) -> list[list[Candidate]]:
    """Group what was found by effect, time constants and the like included; the largest score first."""
    score = {step.label: abs(step.z) for step in d.found.steps}
    groups: dict[tuple[str, ...], list[Candidate]] = {}
    for candidate in sorted(d.chosen, key=lambda c: -score.get(c.label, 0.0)):
        own = candidate.family == "own"
        key = (candidate.label,) if own else (candidate.family, *candidate.effect.options.values())
        groups.setdefault(key, []).append(candidate)
    return list(groups.values())


def _named(d: Diagnosis) -> str:
    """Name what was found by families; of many the ones with the largest scores, and how many more."""
    return _in_words(_families(d))


def _in_words(families: Sequence[Sequence[Candidate]]) -> str:
    """Name families of effects; of many the first ones, and how many more."""
    words = [
        group[0].label if len(group) == 1 else f"{group[0].effect.title} ({', '.join(c.label for c in group)})"
        for group in families
    ]
    if len(words) <= _LISTED:
        return " and ".join(words)
    more = sum(len(group) for group in families[_LARGEST:])
    return f"{', '.join(words[:_LARGEST])} and {more} more"


def _consistent(d: Diagnosis) -> str:
    if d.rungs and d.rungs[0].scatter is not None:
        left = beyond(d.rungs[0].scatter)
        return f"No effect of the catalogue stands out of the scatter of this run; beyond white noise: {left}."
    odd = "; ".join(f.text for f in d.findings)
    told = d.probabilities
    if told is not None and told.nothing < PROBABLE:
        likely = ", ".join(
            f"{f.members[0].label} {in_percent(f.probability)}" for f in told.families[:_LISTED] if f.members
        )
        return f"Something is missing ({in_percent(1.0 - told.nothing)}), but no effect is probable: {likely}."
    nothing = "" if told is None else f" (nothing is missing: {in_percent(told.nothing)})"
    clean = f"The model explains the recording: nothing stands out of the noise{nothing}"
    return f"{clean}; but {odd}." if odd else f"{clean}."


def _unexplained(d: Diagnosis, names: str) -> str:
    if d.rungs and d.rungs[-1].scatter is not None:
        most = f", {d.found.steps[0].label} most" if d.found.steps else ""
        left = beyond(d.rungs[-1].scatter)
        return f"Something stands out of the scatter{most}; beyond white noise: {left}."
    drawn = [term_in_words(term) for term in d.found.noise]
    if any(term.kind in FOLLOWS for term in d.found.noise):
        begun = (
            f"Found, but not all: {names}. What is left is the" if names else "No effect of the catalogue explains the"
        )
        return f"{begun} {' and '.join(drawn)}; the sigmas take it into account."
    if drawn:
        begun = f"Found, but not all: {names}. What is left" if names else "Something is missing that"
        return (
            f"{begun} looks like {' and '.join(drawn)}: a cause outside the catalogue, or a bias that does so; the "
            "sigmas take it into account."
        )
    tail = f"; {names} would take {100 * d.explained:.0f} % of it" if names else ""
    error = held_out_judged(d.after)
    if names and error > 1.0:
        noise = " in the noise that was learned" if noise_learned(d.after) else ""
        tail += f", and the error at stops held out is then {error:.2f}{noise} (1 is right)"
    return f"Something is missing that no effect of the catalogue explains{tail}{_coloured(d.consistency)}."


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
