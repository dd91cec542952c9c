"""`sdimu datasheet`: what was measured in the terms of data sheets, and the certificate of one unit."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

import sdimu_calibration
from sdimu_calibration.cli.console import answer, plain, say
from sdimu_calibration.cli.opened import NOT_TRUSTED, printing, tell
from sdimu_calibration.cli.option_groups import with_options
from sdimu_calibration.cli.options import FoldersArgument, JsonOption, PdfOption, results_in
from sdimu_calibration.cli.wide_table import print_table
from sdimu_calibration.core.data_error import DataError
from sdimu_calibration.storage.files.whole_file import written_together

if TYPE_CHECKING:
    from collections.abc import Sequence

    from sdimu_calibration.core.fleet.datasheet import NoiseOfUnit
    from sdimu_calibration.core.fleet.sheet import Line
    from sdimu_calibration.storage.files.datasheet_file import Certificate
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
    """Make a data sheet from results; leaves datasheet.json and datasheet.html (prints on A4).

    Exit status 3: done, but a limit of --limits does not pass; stderr says which.
    """
    from sdimu_calibration.core.fleet import datasheet as core
    from sdimu_calibration.report.fleet.sheet import HEADINGS, rows, write_page
    from sdimu_calibration.storage.files.datasheet_file import write_datasheet
    from sdimu_calibration.storage.files.fleet_folder import gather
    from sdimu_calibration.storage.files.limits_file import read_limits
    from sdimu_calibration.storage.files.noise_terms_file import read_noise_terms

    console = plain(stderr=as_json)
    printed = printing(console, pdf)
    allowed = {} if limits is None else read_limits(limits, core.known_terms())
    rests = [read_noise_terms(path) for path in noise or _noise_below(folders)]
    gathered = gather(folders, one_model=False)
    entries = _of_unit(gathered.entries, certified.serial, certified.certificate)
    rests, other = _of_same_unit(rests, entries, named=bool(noise))
    for text in (*gathered.apart, *other):
        say(console, f"set apart: {text}")
    lines = core.datasheet([core.Sample(entry.unit, entry.result) for entry in entries], rests)
    lines = tuple(line.against(allowed[line.term]) if line.term in allowed else line for line in lines)
    about = _vouching(entries, certified)
    folder = out or (folders[0] if folders[0].is_dir() else folders[0].parent)
    with written_together(folder) as part:
        write_datasheet(part / "datasheet.json", lines, about, entries)
        write_page(part / "datasheet.html", lines, about, entries, certified.certificate)
    print_table(console, HEADINGS, rows(lines, short=True), left=1)
    missing = [
        f"{name} was not found, so it has no hash: --recording BAG" for name, digest in about.recordings if not digest
    ]
    tell(console, (*_of_other_recordings(rests, entries), *missing))
    printed(folder / "datasheet.html")
    say(console, f"datasheet.json and datasheet.html in {folder}")
    answer(folder / "datasheet.json", as_json)
    _leave(lines)


def _leave(lines: Sequence[Line]) -> None:
    """Say on stderr which limits do not pass, and end with exit status 3 where there is one."""
    from sdimu_calibration.core.fleet.sheet import PASS
    from sdimu_calibration.report.fleet.sheet import against_limit

    missed = [line for line in lines if line.verdict not in {"", PASS}]
    for line in missed:
        typer.echo(f"sdimu: limit: {line.verdict}: {against_limit(line)}", err=True)
    if missed:
        raise typer.Exit(NOT_TRUSTED)


def _vouching(entries: Sequence[Entry], certified: Certified) -> Certificate:
    """Put together who vouches for what."""
    from datetime import UTC, datetime

    from sdimu_calibration.storage.files.datasheet_file import Certificate, hashed

    return Certificate(
        # The name of a folder, by which a unit without a serial goes, is none.
        serial=entries[0].result.origin.serial if len({entry.unit for entry in entries}) == 1 else "",
        date=datetime.now(UTC).strftime("%Y-%m-%d"),
        operator=certified.operator,
        plan=certified.plan,
        version=sdimu_calibration.__version__,
        recordings=hashed(entries, certified.recording or []) if certified.certificate else (),
    )


def _of_same_unit(
    noise: Sequence[NoiseOfUnit], entries: Sequence[Entry], named: bool
) -> tuple[list[NoiseOfUnit], list[str]]:
    """Take the noise of the units of the results, and say which is of another unit.

    Raises DataError for the latter where the user `named` it.
    """
    serials = list(dict.fromkeys(one.result.origin.serial for one in entries if one.result.origin.serial))
    other = [one for one in noise if one.origin.serial and serials and one.origin.serial not in serials]
    told = [
        f"{one.path}: noise of the unit with serial number {one.origin.serial}, and the results are of "
        f"{', '.join(serials)}"
        for one in other
    ]
    if named and told:
        raise DataError(f"--noise {told[0]}: name noise of the same unit, or an IMU file for that of its type")
    return [one for one in noise if one not in other], told


def _of_other_recordings(noise: Sequence[NoiseOfUnit], entries: Sequence[Entry]) -> list[str]:
    """Say which noise is of a recording that none of the results is of, and what is known of it."""
    from sdimu_calibration.report.traceability import recorded
    from sdimu_calibration.storage.files.datasheet_file import recordings_of

    own = {name for entry in entries for name in recordings_of(entry)}
    imus = {entry.result.origin.imu for entry in entries}
    out = []
    for one in noise:
        if not one.terms or one.source in own:
            continue
        about = one.origin
        unit = f"serial {about.serial}" if about.serial else "unit not stated"
        imu = f"IMU file {about.imu}, not that of the results" if about.imu and about.imu not in imus else ""
        known = ", ".join(word for word in (unit, recorded(about.start_ns), imu) if word)
        out.append(f"noise is of another recording than the results: {one.source} ({known})")
    return out


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
