"""`sdimu compare`: the ladder of models from the folders of several runs."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from sdimu_calibration.cli.console import answer, plain, say
from sdimu_calibration.cli.options import JsonOption
from sdimu_calibration.cli.wide_table import print_table
from sdimu_calibration.core.data_error import DataError

if TYPE_CHECKING:
    from sdimu_calibration.core.results import Calibration


_EXPECTED = "compare takes folders with a result.json, as sdimu calibrate and sdimu diagnose leave it, or these files"


def compare(
    folders: Annotated[list[Path], typer.Argument(metavar="DIR DIR ...", help="Folders with result.json.")],
    as_json: JsonOption = False,
) -> None:
    """Show how far the error fell with each model; folders of one recording, in any order."""
    from sdimu_calibration.report.comparison import comparison, headings, remarks, simplest_first

    if len(folders) < 2:
        raise DataError("compare: give at least two folders with a result.json each")
    given = [_read(folder) for folder in folders]
    order = simplest_first(given)
    folders, results = [folders[k] for k in order], [given[k] for k in order]
    lines = comparison([str(folder) for folder in folders], results)
    console = plain(stderr=as_json)
    for remark in remarks(results, order):
        say(console, remark)
    short = [[folder.name, *line[1:]] for folder, line in zip(folders, lines, strict=True)]
    columns = headings(results)
    print_table(console, ("folder", *columns[1:]), short, left=columns.index("log-likelihood"))
    for folder in folders:
        verdict = _verdict(folder)
        if verdict:
            say(console, f"{folder.name}: {verdict}")
    rungs = [dict(zip(columns[1:], line[1:], strict=True)) for line in lines]
    answer(_content(folders, rungs, results), as_json)


def _read(path: Path) -> Calibration:
    """Read a result; what is none is told with what is expected."""
    from sdimu_calibration.storage.files.result_file import read_result

    if path.is_file() and path.suffix != ".json":
        raise DataError(f"{path}: is no result; {_EXPECTED}")
    try:
        return read_result(path)
    except DataError as error:
        raise DataError(f"{error}; {_EXPECTED}") from error


def _content(folders: list[Path], rungs: list[dict[str, str]], results: list[Calibration]) -> dict[str, Any]:
    """Give the ladder as plain data: what the table says, with the numbers of each fit as its file has them."""
    models: list[dict[str, Any]] = [
        {"folder": str(folder), "model": list(result.model), "fit": dict(result.fit), "table": rung}
        for folder, rung, result in zip(folders, rungs, results, strict=True)
    ]
    for k, model in enumerate(models):
        model["wrong_without_it"] = _wrong(results[k - 1], results[k]) if k else []
    return {"format": "sdimu-comparison/1", "models": models}


def _wrong(before: Calibration, after: Calibration) -> list[dict[str, Any]]:
    """Give the coefficients that are wrong in the model before, SI: `amount` is by how much it is too large there."""
    from sdimu_calibration.core.units import to_si
    from sdimu_calibration.report.cost import coefficients_off

    units = dict(zip(before.names, before.units, strict=True))
    return [
        {
            "coefficient": one.name,
            "amount": to_si(one.amount, one.unit),
            "sigma": to_si(one.sigma, one.unit),
            "unit": units[one.name],
            "display_unit": one.unit,
            "sigmas": one.sigmas,
        }
        for one in coefficients_off(before, after)
    ]


def _verdict(folder: Path) -> str:
    """Sentence of the diagnosis in a folder; empty when there is none."""
    from sdimu_calibration.storage.files.diagnosis_file import read_diagnosis

    if not (folder / "diagnosis.json").is_file():
        return ""
    return read_diagnosis(folder).sentence
