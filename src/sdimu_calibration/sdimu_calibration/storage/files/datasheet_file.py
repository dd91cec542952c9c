"""A data sheet as datasheet.json (format ``sdimu-datasheet/1``), and the files that a certificate vouches for."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Final, Literal

from sdimu_calibration.core.fleet import sheet
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.storage.files.file_hashes import file_hashes
from sdimu_calibration.storage.files.fleet_folder import Entry
from sdimu_calibration.storage.files.json_file import entry
from sdimu_calibration.storage.files.result_model import Entry as DataclassEntry
from sdimu_calibration.storage.files.result_model import Line, ResultModel

FORMAT: Final = "sdimu-datasheet/1"


@dataclass(frozen=True)
class Certificate:
    """Who vouches for what; empty where nobody said it."""

    serial: str = ""
    date: str = ""
    operator: str = ""
    plan: str = ""
    version: str = ""
    """`serial`, `date`, `operator`, `plan`, `version`: unit, day of the certificate, person, test plan, version of the
    program."""
    recordings: tuple[tuple[str, str], ...] = ()
    """Name and SHA-256 of each file of the recordings; the second is empty where the file was not found."""


class HashedFile(ResultModel):
    """A file of a recording; its digest is empty where the file was not found."""

    file: Line
    sha256: Line


class SheetResult(ResultModel):
    """A result that the data sheet is made of."""

    name: Line
    unit: Line


class DatasheetFile(ResultModel):
    """datasheet.json, in the order of its keys: a `Certificate`, then what it vouches for."""

    format: Literal["sdimu-datasheet/1"] = FORMAT
    serial: Line = ""
    date: Line = ""
    operator: Line = ""
    plan: Line = ""
    version: Line = ""
    recordings: tuple[HashedFile, ...] = ()
    results: tuple[SheetResult, ...]
    lines: tuple[Annotated[sheet.Line, DataclassEntry({"verdict": lambda line: line.verdict})], ...]


def write_datasheet(path: Path, lines: Sequence[sheet.Line], about: Certificate, entries: Sequence[Entry]) -> None:
    """Write datasheet.json: SI numbers, ``null`` for what was not measured.

    `entries`: the results that it is made of.
    """
    DatasheetFile.model_construct(
        format=FORMAT,
        **entry(about, "serial date operator plan version"),
        recordings=tuple(HashedFile.model_construct(file=name, sha256=digest) for name, digest in about.recordings),
        results=tuple(SheetResult.model_construct(**entry(one, "name unit")) for one in entries),
        lines=tuple(lines),
    ).write(path)


def hashed(entries: Sequence[Entry], given: Sequence[Path]) -> tuple[tuple[str, str], ...]:
    """Hash the files of the recordings of some results.

    `entries`: a recording is looked for beside the folder of its result, where `sdimu calibrate` leaves it; `given`:
    recordings that are elsewhere.
    """
    for path in given:
        if not path.exists():
            raise DataError(f"{path}: no such recording")
    named = list(dict.fromkeys((name, entry.path) for entry in entries for name in recordings_of(entry)))
    out: dict[Path, tuple[str, str]] = {}
    missing: list[tuple[str, str]] = []
    for name, folder in named:
        places = [path for path in given if path.resolve().name == name] + [folder.parent / name, folder / name]
        found = next((path for path in places if path.exists()), None)
        if found is None:
            missing.append((name, ""))
        else:
            out |= file_hashes(found)
    for path in given:
        out |= file_hashes(path)
    return (*out.values(), *missing)


def recordings_of(entry: Entry) -> list[str]:
    """Names of the recordings that a result is of, as far as it says them."""
    of_set = entry.result.of_set
    if of_set is not None:
        return [one.name for one in of_set.recordings]
    return [entry.result.origin.recording] if entry.result.origin.recording else []
