"""A data sheet as datasheet.json (format ``sdimu-datasheet/1``), and the files that a certificate vouches for."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from sdimu_calibration.core.fleet import sheet
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.storage.files.file_hashes import file_hashes
from sdimu_calibration.storage.files.fleet_folder import Entry
from sdimu_calibration.storage.files.json_file import entry, write_json

FORMAT = "sdimu-datasheet/1"


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


def write_datasheet(path: Path, lines: Sequence[sheet.Line], about: Certificate, entries: Sequence[Entry]) -> None:
    """Write datasheet.json: SI numbers, ``null`` for what was not measured."""
    content = {
        "format": FORMAT,
        **entry(about, "serial date operator plan version"),
        "recordings": [{"file": name, "sha256": digest} for name, digest in about.recordings],
        "results": [entry(one, "name unit") for one in entries],
        "lines": [asdict(line) | {"verdict": line.verdict} for line in lines],
    }
    write_json(path, content)


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
