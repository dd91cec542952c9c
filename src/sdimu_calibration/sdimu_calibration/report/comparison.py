"""The ladder of models: results of one recording side by side."""

from __future__ import annotations

from collections.abc import Sequence

from sdimu_calibration.core.diagnosis.ladder import moved_coefficients, number
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.results import Calibration

HEADINGS = ("name", "model", "log-likelihood", "difference", "nis", "held-out", "moved by more than 2 sigma")
OTHER_SCALE = (
    "not with one site and one noise specification: log-likelihoods and NIS are of different scales"
)
_MOST_MOVED = 6


def comparison(names: Sequence[str], results: Sequence[Calibration]) -> list[list[str]]:
    """Rows of `HEADINGS`, one a result, each against the one before it.

    Parameters
    ----------
    names : sequence of str
    results : sequence of Calibration
        Of one recording, the simplest model first.

    Raises
    ------
    DataError
        When there are fewer than two, or they are of different recordings or body frames.
    """
    if len(results) < 2:
        raise DataError("compare: give at least two results of one recording")
    _check_same_data(names, results)
    return [
        _row(names[k], result, results[k - 1] if k else None) for k, result in enumerate(results)
    ]


def other_scale(results: Sequence[Calibration]) -> bool:
    """Whether the results are of different sites or noise specifications."""
    return any(_differ(result, results[0], "conditions") for result in results[1:])


def _check_same_data(names: Sequence[str], results: Sequence[Calibration]) -> None:
    first = results[0]
    for name, result in zip(names[1:], results[1:], strict=True):
        if result.body_frame != first.body_frame:
            raise DataError(
                f"{name}: body frame is {result.body_frame}, of {names[0]} it is {first.body_frame} "
                "(calibrate both with models of one body_frame)"
            )
        if any(_differ(result, first, key) for key in ("samples", "duration_s", "checksum")):
            raise DataError(f"{name}: is of another recording than {names[0]} (compare models on one recording)")


def _differ(a: Calibration, b: Calibration, key: str) -> bool:
    """Whether two results say different things of their data; one that says nothing does not differ."""
    return key in a.data and key in b.data and a.data[key] != b.data[key]


def _row(name: str, result: Calibration, before: Calibration | None) -> list[str]:
    likelihood, nis, held_out = (number(result.fit.get(k)) for k in ("log_likelihood", "nis_mean", "held_out_rms"))
    if before is None:
        model, difference, moved = f"{len(result.model)} effects", "", ""
    else:
        model = _change(before.model, result.model)
        difference = f"{likelihood - number(before.fit.get('log_likelihood')):+.1f}"
        sizes = moved_coefficients(before, result)[:_MOST_MOVED]
        moved = ", ".join(f"{coefficient} {size:+.1f}" for coefficient, size in sizes)
    return [name, model, f"{likelihood:.1f}", difference, f"{nis:.3f}", f"{held_out:.3f}", moved]


def _change(before: tuple[str, ...], after: tuple[str, ...]) -> str:
    added = [f"+ {name}" for name in after if name not in before]
    gone = [f"- {name}" for name in before if name not in after]
    return ", ".join([*added, *gone]) or "same"
