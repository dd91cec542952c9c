"""`sdimu compare`: the ladder of models from the folders of several runs."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from sdimu_calibration.core.results import Calibration


def compare(
    folders: Annotated[list[Path], typer.Argument(metavar="DIR DIR ...", help="Folders with result.json.")],
) -> None:
    """Show how far the error fell with each model; folders of one recording, simplest model first."""
    from rich.console import Console

    from sdimu_calibration.cli.wide_table import print_table
    from sdimu_calibration.core.recording import DataError
    from sdimu_calibration.storage.result_file import read_result

    if len(folders) < 2:
        raise DataError("compare: give at least two folders with a result.json each")
    results = [read_result(folder) for folder in folders]
    _same_data(folders, results)
    console = Console()
    if any(_differ(result, results[0], "conditions") for result in results[1:]):
        console.print("not with one site and one noise specification: log-likelihoods and NIS are of different scales")
    headings = ("folder", "model", "log-likelihood", "difference", "nis", "held-out", "moved by more than 2 sigma")
    lines = [_row(folders[k], result, results[k - 1] if k else None) for k, result in enumerate(results)]
    print_table(console, headings, lines, left=2)
    for folder in folders:
        verdict = _verdict(folder)
        if verdict:
            console.print(f"{folder.name}: {verdict}", soft_wrap=True, markup=False, highlight=False)


def _same_data(folders: list[Path], results: list[Calibration]) -> None:
    """Refuse what cannot be compared: another recording, another body frame."""
    from sdimu_calibration.core.recording import DataError

    first = results[0]
    for folder, result in zip(folders[1:], results[1:], strict=True):
        if result.body_frame != first.body_frame:
            raise DataError(
                f"{folder}: body frame is {result.body_frame}, of {folders[0]} it is {first.body_frame} "
                "(calibrate both with models of one body_frame)"
            )
        if any(_differ(result, first, key) for key in ("samples", "duration_s", "checksum")):
            raise DataError(f"{folder}: is of another recording than {folders[0]} (compare models on one recording)")


def _differ(a: Calibration, b: Calibration, key: str) -> bool:
    """Whether two results say different things of their data; one that says nothing does not differ."""
    return key in a.data and key in b.data and a.data[key] != b.data[key]


def _row(folder: Path, result: Calibration, before: Calibration | None) -> list[str]:
    from sdimu_calibration.core.diagnosis.grow import moved_coefficients

    if before is None:
        model, difference, moved = f"{len(result.model)} effects", "", ""
    else:
        model = _change(before.model, result.model)
        difference = f"{_value(result, 'log_likelihood') - _value(before, 'log_likelihood'):+.1f}"
        moved = ", ".join(f"{name} {size:+.1f}" for name, size in moved_coefficients(before, result)[:6])
    return [
        folder.name, model, f"{_value(result, 'log_likelihood'):.1f}", difference,
        f"{_value(result, 'nis_mean'):.3f}", f"{_value(result, 'held_out_rms'):.3f}", moved,
    ]  # fmt: skip


def _change(before: tuple[str, ...], after: tuple[str, ...]) -> str:
    added = [f"+ {name}" for name in after if name not in before]
    gone = [f"- {name}" for name in before if name not in after]
    return ", ".join([*added, *gone]) or "same"


def _value(result: Calibration, key: str) -> float:
    value = result.fit.get(key)
    return float("nan") if value is None else float(value)


def _verdict(folder: Path) -> str:
    """Sentence of the diagnosis in a folder; empty when there is none."""
    from sdimu_calibration.storage.diagnosis_file import read_diagnosis

    if not (folder / "diagnosis.json").is_file():
        return ""
    content: dict[str, Any] = read_diagnosis(folder)
    return str(content.get("sentence", ""))
