"""The ladder of models: results of one recording side by side."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

from sdimu_calibration.core.error_figures import (
    held_out_judged,
    held_out_ladder,
    is_handheld,
    log_likelihood,
    nis,
    noise_learned,
)
from sdimu_calibration.core.plain_text import counted
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.results import Calibration
from sdimu_calibration.core.units import from_si
from sdimu_calibration.report.cost import OVER_MODELS, TOO_LARGE, coefficients_off

_HEADINGS = ("name", "model", "log-likelihood", "difference", "nis", "held-out", "wrong without it")
_NOISE = "noise learned"
_OTHER_STOPS = "the results leave out different stops: their log-likelihoods and errors do not compare"
_OTHER_SCALE = "not with one site and one noise specification: log-likelihoods and NIS are of different scales"
_BY_HAND = (
    "held-out: the force of each rest by hand predicted from everything else, in sigmas of the last model; every model "
    "learns a scatter of its own, in which its log-likelihood is, and its NIS and its own held-out error are near 1"
)
_TWO_KINDS = "some by hand and some navigated: neither log-likelihoods nor held-out errors compare"
_IN_FILE = "log-likelihood, nis and held-out: in the white noise of the IMU's file"
_IN_OWN = (
    "log-likelihood: of each model in the noise that it learned itself; the ladder of refits of a diagnosis has all of "
    "its models in one noise, that which the diagnosis found, so its numbers are others"
)
_IN_WHITE = (
    "nis and held-out: in white noise, in which models compare; where noise was learned, 1 is "
    "right for the error in that noise"
)
_SIGMAS = f"+-: one sigma if the model of the line is right; of a diagnosis, {OVER_MODELS}"
_OFF_SIGN = f"wrong without it: coefficients of the model above; {TOO_LARGE}"
_REORDERED = "models stand in the order of their numbers of coefficients, the simplest first, not as they were named"
_MOST_MOVED = 6


def headings(results: Sequence[Calibration]) -> tuple[str, ...]:
    """Columns of `comparison`; that of noise where a result learned any."""
    learned = any(result.noise for result in results)
    return (*_HEADINGS[:2], _NOISE, *_HEADINGS[2:]) if learned else _HEADINGS


def comparison(names: Sequence[str], results: Sequence[Calibration]) -> list[list[str]]:
    """Rows of `headings`, one a result, each against the one before it.

    `results`: of one recording, in the order of `simplest_first`.
    """
    if len(results) < 2:
        raise DataError("compare: give at least two results of one recording")
    _check_same_data(names, results)
    held_out = held_out_ladder(results)
    lines = [_row(names[k], result, results[k - 1] if k else None, held_out[k]) for k, result in enumerate(results)]
    if _NOISE in headings(results):
        for line, result in zip(lines, results, strict=True):
            line.insert(2, _noise(result))
    return lines


def simplest_first(results: Sequence[Calibration]) -> list[int]:
    """Places of results by the number of their coefficients; those with as many as another stay in their order."""
    return sorted(range(len(results)), key=lambda k: len(results[k].names))


def remarks(results: Sequence[Calibration], named: Sequence[int]) -> tuple[str, ...]:
    """Say what the columns mean and where they do not compare, one line each. `named`: as `simplest_first` gave it."""
    handheld = [is_handheld(result) for result in results]
    learned = any(map(noise_learned, results))
    return (
        *([_REORDERED] if list(named) != sorted(named) else []),
        *([_OTHER_STOPS] if any(_differ(result, results[0], "stops") for result in results[1:]) else []),
        *([_OTHER_SCALE] if any(_differ(result, results[0], "conditions") for result in results[1:]) else []),
        *([_IN_OWN, _IN_WHITE] if learned else [] if any(handheld) else [_IN_FILE]),
        *([_OFF_SIGN, _SIGMAS] if any(coefficients_off(*two) for two in pairwise(results)) else []),
        *([_BY_HAND] if all(handheld) else [_TWO_KINDS] if any(handheld) else []),
    )


def _noise(result: Calibration) -> str:
    """Noise with a memory that was learned, in words with sizes, and the held-out error in it."""
    terms = ", ".join(
        f"{term.words} {from_si(term.size, term.display_unit):.2g} {term.display_unit}" for term in result.noise
    )
    return (terms or "none") + (f"; held-out {held_out_judged(result):.3f}" if noise_learned(result) else "")


def _check_same_data(names: Sequence[str], results: Sequence[Calibration]) -> None:
    first = results[0]
    for name, result in zip(names[1:], results[1:], strict=True):
        if result.body_frame != first.body_frame:
            raise DataError(
                f"{name}: its body frame is {result.body_frame}, that of {names[0]} is {first.body_frame} "
                "(calibrate both with models of the same body_frame)"
            )
        if any(_differ(result, first, key) for key in ("samples", "duration_s", "checksum")):
            raise DataError(f"{name}: it is of another recording than {names[0]} (compare models of one recording)")


def _differ(a: Calibration, b: Calibration, key: str) -> bool:
    """Whether two results say different things of their data; one that says nothing does not differ."""
    return key in a.data and key in b.data and a.data[key] != b.data[key]


def _row(name: str, result: Calibration, before: Calibration | None, held_out: float) -> list[str]:
    # Of a set it lacks what its recordings hold of their own, and each model stands in a noise of its own.
    likelihood = float("nan") if result.of_set is not None else log_likelihood(result)
    if before is None:
        model, difference, moved = counted(len(result.model), "effect"), "", ""
    else:
        model = _change(before.model, result.model)
        gain = likelihood - log_likelihood(before)
        difference = "" if math.isnan(gain) else f"{gain:+.1f}"
        moved = ", ".join(off.text for off in coefficients_off(before, result)[:_MOST_MOVED])
    told = "" if math.isnan(likelihood) else f"{likelihood:.1f}"
    return [name, model, told, difference, f"{nis(result):.3f}", f"{held_out:.3f}", moved]


def _change(before: tuple[str, ...], after: tuple[str, ...]) -> str:
    added = [f"+ {name}" for name in after if name not in before]
    gone = [f"- {name}" for name in before if name not in after]
    return ", ".join([*added, *gone]) or "same"
