"""`sdimu set`: files that say which recordings are of one unit."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from sdimu_calibration.cli.console import plain
from sdimu_calibration.cli.verb_group import VerbGroup
from sdimu_calibration.shell_words import joined

app = typer.Typer(
    cls=VerbGroup, help="Say which recordings are of one unit, for calibrate and diagnose --set.", no_args_is_help=True
)


@app.callback()
def about() -> None:
    """Say which recordings are of one unit, for calibrate and diagnose --set."""


@app.command()
def init(
    places: Annotated[
        list[Path], typer.Argument(metavar="FOLDER|BAG ...", help="Folders with bags, bags, .mcap and .db3 files.")
    ],
    out: Annotated[
        Path | None,
        typer.Option(help="Set file to write; set.yaml in the folder, or beside the first bag, by default."),
    ] = None,
    serial: Annotated[
        str | None, typer.Option(metavar="NUMBER", help="Serial number of the unit, for all recordings.")
    ] = None,
    power_on: Annotated[
        str | None, typer.Option(metavar="NAME", help="Switch-on that all recordings share: they share their biases.")
    ] = None,
    replace: Annotated[bool, typer.Option("--replace", help="Replace a set file that is already there.")] = False,
) -> None:
    """Write a first set file of bags, or of the bags in folders."""
    from sdimu_calibration.storage.recording_set import Said, bags_of, is_bag, write_set

    found = bags_of(places)
    first = places[0].resolve()
    path = out or (first.parent if is_bag(first) else first) / "set.yaml"
    write_set(path, found, Said(serial or "", power_on or ""), replace=replace)
    missing = " and ".join(word for word, said in (("serial", serial), ("power_on", power_on)) if said is None)
    then = f"complete {missing}, then" if missing else "now"
    using = joined(["sdimu", "calibrate", "--set", str(path)])
    plain().print(f"{path}: {len(found)} recordings; {then}: {using}", soft_wrap=True)
