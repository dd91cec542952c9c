"""What a diagnosis by hand has to say: each effect, where the model failed, what could not be seen, advice."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sdimu_calibration.core.arrays import Floats, Ints
from sdimu_calibration.core.diagnosis.coefficient_shifts import coefficient_shifts
from sdimu_calibration.core.diagnosis.found import DetectableSize, Found
from sdimu_calibration.core.diagnosis.handheld_diagnosis import HandheldDiagnosis
from sdimu_calibration.core.diagnosis.handheld_evidence import CHANNELS, HandheldEvidence, standardised
from sdimu_calibration.core.diagnosis.scan import POWER_80, Scan, alike
from sdimu_calibration.core.diagnosis.search import Problem
from sdimu_calibration.core.handheld.handheld_fit import FORCE, RATE, TURN
from sdimu_calibration.core.probability import normal_tail
from sdimu_calibration.core.units import from_si


@dataclass(frozen=True)
class Place:
    """Residual of one channel at one rest, or on the way to it, over its own sigma."""

    channel: str
    stop: int
    normalised: float


@dataclass(frozen=True)
class HandheldSummary:
    """What people and files read of a diagnosis by hand.

    Attributes
    ----------
    diagnosis : HandheldDiagnosis
    sentence : str
    found : tuple of Found
    where : tuple of Place
        With the model as given, in sigmas of the last fit; the largest first.
    after : tuple of Place
        The same with what was found.
    first, last : Scan
        Of all candidates, with the model as given and with what was found; in sigmas of the last fit.
    reached : tuple of DetectableSize
    advice : tuple of str
    """

    diagnosis: HandheldDiagnosis
    sentence: str
    found: tuple[Found, ...]
    where: tuple[Place, ...]
    after: tuple[Place, ...]
    first: Scan
    last: Scan
    reached: tuple[DetectableSize, ...]
    advice: tuple[str, ...]


def summarise_handheld(d: HandheldDiagnosis) -> HandheldSummary:
    """Work out what a diagnosis has to say."""
    problem = Problem(d.evidence)
    chosen = [int(c) for c in d.chosen]
    first, last = problem.scan([]), problem.scan(chosen)
    found = _found(d, problem, chosen)
    return HandheldSummary(
        d, _sentence(d, found), found, places(d.evidence, []), places(d.evidence, chosen), first, last,
        _reach(d, first), _advice(d, found),
    )  # fmt: skip


def beyond(extra: Floats) -> str:
    """Say what is left beyond white noise."""
    force, rate, turn = from_si(float(extra[FORCE]), "ug"), float(np.degrees(extra[RATE])), 100.0 * float(extra[TURN])
    return f"force {shown(force)} ug, rate {shown(rate)} deg/s, turns {shown(turn)} % of the way"


def shown(value: float) -> str:
    """Write a learned sigma in its customary unit; what only rounding made is nought."""
    return f"{value:.3g}" if value > _ROUNDING else "0"


_ROUNDING = 1e-6


def places(evidence: HandheldEvidence, chosen: list[int]) -> tuple[Place, ...]:
    """Residuals over their own sigmas, the largest first."""
    values = standardised(evidence, np.array(chosen, dtype=np.int64))
    rows = [
        Place(CHANNELS[c], int(s), float(v))
        for c, s, v in zip(evidence.channel, evidence.stop, values, strict=True) if np.isfinite(v)
    ]  # fmt: skip
    return tuple(sorted(rows, key=lambda place: -abs(place.normalised)))


def _found(d: HandheldDiagnosis, problem: Problem[HandheldEvidence], chosen: list[int]) -> tuple[Found, ...]:
    """Take the ladder apart, in its order."""
    p, m = problem.p, len(chosen)
    known = [problem.known(chosen[:k]) for k in range(m + 1)]
    left = [_chi2(problem, *part[:2]) for part in known]
    misfit = max(left[0] - left[-1], 1e-9)
    out = []
    for k, column in enumerate(chosen):
        scanned = problem.scan(chosen[:k])
        scores = problem.scores(problem.scan([c for c in chosen if c != column]))
        others = alike(scores, column)
        count = int(np.isfinite(scanned.sigma).sum())
        z = float(scanned.z[column])
        value, sigma = d.after.values[k - m], float(np.sqrt(d.after.covariance[k - m, k - m]))
        out.append(
            Found(
                candidate=d.evidence.candidates[column - p], value=float(value), sigma=sigma, z=z,
                log_likelihood_gain=0.5 * z * z,
                log_bayes_factor=d.rungs[k + 1].log_likelihood - d.rungs[k].log_likelihood,
                p_value_adjusted=float(min(1.0, count * 2.0 * normal_tail(float(abs(z))))),
                explained=(left[k] - left[k + 1]) / misfit,
                held_out_before=d.rungs[k].held_out, held_out_after=d.rungs[k + 1].held_out,
                alike=tuple(d.evidence.names[i] for i in others),
                coefficient_shifts=coefficient_shifts(problem, chosen, column, others, 1.0),
            )
        )  # fmt: skip
    return tuple(out)


def _chi2(problem: Problem[HandheldEvidence], known: Ints, weight: Floats) -> float:
    estimate, _ = problem.evidence.information.estimate(known, weight)
    residual = problem.evidence.e - problem.evidence.W[:, known] @ estimate
    return float(residual @ residual)


def _reach(d: HandheldDiagnosis, first: Scan) -> tuple[DetectableSize, ...]:
    """Smallest size of each candidate that this run would have shown, in the scatter of its last fit."""
    p = len(d.evidence.weight)
    out = []
    for i, candidate in enumerate(d.evidence.candidates, start=p):
        size = float(POWER_80 * first.sigma[i])
        unit = candidate.parameter
        out.append(
            DetectableSize(
                candidate.label, candidate.family, unit.unit, unit.display_unit, size, float(first.retention[i]),
                bool(np.isfinite(size)),
            )
        )  # fmt: skip
    return tuple(out)


def _sentence(d: HandheldDiagnosis, found: tuple[Found, ...]) -> str:
    """Put the verdict into one sentence."""
    names = " and ".join(f.candidate.label for f in found)
    left = beyond(d.rungs[-1].extra)
    if d.verdict == "data fault":
        return f"The data have a fault: {'; '.join(d.after.warnings)}."
    if d.verdict == "consistent":
        return f"No effect of the catalogue stands out of what this run by hand scatters; beyond white noise: {left}."
    if d.verdict == "unexplained":
        return (
            f"Something stands out of the scatter, {d.steps[0].label} most, but adding it does not help; "
            f"beyond white noise: {left}."
        )
    rest = (
        f"error at rests held out: {d.rungs[0].held_out:.3f} -> {d.rungs[-1].held_out:.3f}; "
        f"beyond white noise: {beyond(d.rungs[0].extra)} -> {left}."
    )
    if d.verdict == "own equation":
        return f"Something is missing that is not in the catalogue; it follows {names}; {rest}"
    if d.verdict == "class of effects":
        others = ", ".join(found[0].alike[:4])
        return f"One effect is missing: {names}, or what looks the same here ({others}); {rest}"
    return f"{'One effect is' if d.verdict == 'one effect' else 'Several effects are'} missing: {names}; {rest}"


def _advice(d: HandheldDiagnosis, found: tuple[Found, ...]) -> tuple[str, ...]:
    """Advise in sentences."""
    out = []
    for one in found:
        label = one.candidate.label
        out.append(f"Keep {label} in the model: --add '{label}'.")
        if one.alike:
            out.append(f"To tell {label} from {', '.join(one.alike[:3])}: {_more(one)}.")
            out += [
                f"Which it is matters: with {s.other} instead of {label}, {s.coefficient} moves by {s.sigmas:+.0f} of "
                "its sigmas." for s in one.coefficient_shifts[:3]
            ]  # fmt: skip
    if d.verdict == "unexplained":
        out.append("Record the run again in another order: what comes back at the same attitude belongs to the sensor.")
    return tuple(out)


def _more(one: Found) -> str:
    """Say what to do by hand that would tell a class apart."""
    if "(" in one.candidate.label or any(word in one.candidate.family for word in ("ramp", "temperature")):
        return "come back to the first attitudes at the end, and rest there"
    if one.candidate.family.startswith("gyro"):
        return "turn about that axis both ways, slowly and fast"
    return "rest in more attitudes between the axes, both ends of that axis up"
