"""`sdimu fleet`: many units of one type."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from sdimu_calibration.cli.console import answer, plain, say
from sdimu_calibration.cli.options import FoldersArgument, JsonOption, results_in
from sdimu_calibration.cli.wide_table import print_table
from sdimu_calibration.storage.files.whole_file import written_together


def fleet(
    folders: FoldersArgument,
    priors: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Write an IMU file with the priors of the population.")
    ] = None,
    imu: Annotated[
        str | None, typer.Option(help="IMU whose noise and grade go into --priors; that of the results by default.")
    ] = None,
    out: Annotated[Path | None, results_in("pages; FOLDER")] = None,
    replace: Annotated[
        bool, typer.Option("--replace", help="Replace a file that is already in the place of --priors.")
    ] = False,
    as_json: JsonOption = False,
) -> None:
    """Compare all units of a type: mean and spread, who is out, what is common; leaves fleet.json and fleet.html."""
    from sdimu_calibration.core.fleet.study import study
    from sdimu_calibration.report.fleet import tables
    from sdimu_calibration.report.fleet.page import display_units, headline, write_page
    from sdimu_calibration.storage.bags.file_room import check_file_room
    from sdimu_calibration.storage.files.config import load_imu
    from sdimu_calibration.storage.files.fleet_file import write_fleet, write_priors
    from sdimu_calibration.storage.files.fleet_folder import as_measured, candidates, gather

    console = plain(stderr=as_json)
    if imu is not None:
        load_imu(imu)
    if priors is not None:
        read = [path for folder in folders for path in ([folder] if folder.is_file() else folder.rglob("*.json"))]
        check_file_room(priors, "--priors", kind="sdimu-imu", replace=replace, sources=read)
    gathered = gather(folders)
    for line in gathered.apart:
        say(console, f"set apart: {line}")
    alone = candidates(gathered.given)
    done = study(as_measured(gathered.entries), gathered.entries[0].result.model, alone)
    units = display_units(gathered, alone)
    folder = out or (folders[0] if folders[0].is_dir() else folders[0].parent)
    with written_together(folder) as part:
        write_fleet(part / "fleet.json", gathered, done)
        write_page(part / "fleet.html", gathered, done, alone, f"Fleet of {folders[0].resolve().name}")
    written = write_priors(priors, imu or gathered.entries[0].result.origin.imu, gathered, done) if priors else ()
    say(console, headline(gathered, done))
    print_table(console, tables.HEADINGS, tables.rows(done, units), left=2)
    for line in tables.sentences(done, units):
        say(console, line)
    if priors is not None:
        say(console, f"priors of {len(written)} effects in {priors}; use: --imu {priors}")
    say(console, f"fleet.json and fleet.html in {folder}")
    answer(folder / "fleet.json", as_json)
