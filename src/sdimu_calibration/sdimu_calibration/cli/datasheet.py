"""`sdimu datasheet`: what was measured in the terms of data sheets, and the certificate of one unit."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

import sdimu_calibration
from sdimu_calibration.cli.console import answer, plain, say
from sdimu_calibration.cli.opened import printing
from sdimu_calibration.cli.option_groups import with_options
from sdimu_calibration.cli.options import FoldersArgument, JsonOption, PdfOption, results_in
from sdimu_calibration.cli.wide_table import print_table
from sdimu_calibration.core.data_error import DataError
from sdimu_calibration.storage.files.whole_file import written_together

if TYPE_CHECKING:
    from collections.abc import Sequence

    from sdimu_calibration.storage.files.fleet_folder import Entry


@dataclass(frozen=True)
class Certified:
    """What a certificate says of a unit and its test."""

    certificate: Annotated[bool, typer.Option("--certificate", help="Of one unit: --serial, with hashes.")] = False
    serial: Annotated[str | None, typer.Option(help="Results of this unit alone.")] = None
    operator: Annotated[str, typer.Option(help="Who made the test, for the certificate.")] = ""
    plan: Annotated[str, typer.Option(help="Test plan, for the conditions.")] = ""
    recording: Annotated[
        list[Path] | None, typer.Option(metavar="BAG", help="Recording to hash that is not beside its result.")
    ] = None


@with_options
def datasheet(
    folders: FoldersArgument,
    limits: Annotated[
        Path | None, typer.Option(metavar="FILE", help="YAML with the largest size of each term: pass or fail.")
    ] = None,
    noise: Annotated[
        list[Path] | None,
        typer.Option(metavar="FILE", help="noise.json of sdimu noise (or its folder), or an IMU file; repeatable."),
    ] = None,
    *,
    certified: Certified,
    out: Annotated[Path | None, results_in("pages; FOLDER")] = None,
    pdf: PdfOption = False,
    as_json: JsonOption = False,
) -> None:
    """Make a data sheet from results; leaves datasheet.json and datasheet.html (prints on A4)."""
    from datetime import UTC, datetime

    from sdimu_calibration.core.fleet import datasheet as core
    from sdimu_calibration.report.fleet.sheet import HEADINGS, rows, write_page
    from sdimu_calibration.storage.files.datasheet_file import Certificate, hashed, write_datasheet
    from sdimu_calibration.storage.files.fleet_folder import gather
    from sdimu_calibration.storage.files.limits_file import read_limits
    from sdimu_calibration.storage.files.noise_terms_file import read_noise_terms

    console = plain(stderr=as_json)
    printed = printing(console, pdf)
    allowed = {} if limits is None else read_limits(limits, core.known_terms())
    rests = [read_noise_terms(path) for path in noise or _noise_below(folders)]
    gathered = gather(folders, one_model=False)
    for line in gathered.apart:
        say(console, f"set apart: {line}")
    entries = _of_unit(gathered.entries, certified.serial, certified.certificate)
    lines = core.datasheet([core.Sample(entry.unit, entry.result) for entry in entries], rests)
    lines = tuple(line.against(allowed[line.term]) if line.term in allowed else line for line in lines)
    about = Certificate(
        # The name of a folder, by which a unit without a serial goes, is none.
        serial=entries[0].result.origin.serial if len({entry.unit for entry in entries}) == 1 else "",
        date=datetime.now(UTC).strftime("%Y-%m-%d"),
        operator=certified.operator,
        plan=certified.plan,
        version=sdimu_calibration.__version__,
        recordings=hashed(entries, certified.recording or []) if certified.certificate else (),
    )
    folder = out or (folders[0] if folders[0].is_dir() else folders[0].parent)
    with written_together(folder) as part:
        write_datasheet(part / "datasheet.json", lines, about, entries)
        write_page(part / "datasheet.html", lines, about, entries, certified.certificate)
    print_table(console, HEADINGS, rows(lines, short=True), left=1)
    for name, digest in about.recordings:
        if not digest:
            say(console, f"note: {name} was not found, so it has no hash: --recording BAG")
    printed(folder / "datasheet.html")
    say(console, f"datasheet.json and datasheet.html in {folder}")
    answer(folder / "datasheet.json", as_json)


def _noise_below(folders: Sequence[Path]) -> list[Path]:
    """Every noise.json below the folders."""
    from sdimu_calibration.storage.files.noise_terms_file import NAME

    return [path for folder in folders if folder.is_dir() for path in sorted(folder.rglob(NAME))]


def _of_unit(entries: tuple[Entry, ...], serial: str | None, certificate: bool) -> tuple[Entry, ...]:
    """Take the results of one unit, where one is named or a certificate needs one."""
    units = list(dict.fromkeys(entry.unit for entry in entries))
    if serial is not None and serial not in units:
        raise DataError(f"--serial {serial}: no result has this serial number (there are: {', '.join(units)})")
    if certificate and serial is None and len(units) > 1:
        raise DataError(f"--certificate: it is of one unit; choose that with --serial (there are: {', '.join(units)})")
    return tuple(entry for entry in entries if serial in {None, entry.unit})
