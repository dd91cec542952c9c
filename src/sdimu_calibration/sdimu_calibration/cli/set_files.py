"""`sdimu set`: files that say which recordings are of one unit."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from sdimu_calibration.cli.console import plain

app = typer.Typer(help="Say which recordings are of one unit, for calibrate and diagnose --set.", no_args_is_help=True)


@app.callback()
def about() -> None:
    """Say which recordings are of one unit, for calibrate and diagnose --set."""


@app.command()
def init(
    folder: Annotated[Path, typer.Argument(metavar="FOLDER", help="Folder with the bags.")],
    out: Annotated[Path | None, typer.Option(help="Set file to write; FOLDER/set.yaml by default.")] = None,
) -> None:
    """Write a first set file of the bags in a folder."""
    from sdimu_calibration.storage.recording_set import bags_below, write_set

    found = bags_below(folder)
    path = out or folder / "set.yaml"
    write_set(path, found)
    plain().print(
        f"{path}: {len(found)} recordings; complete serial and power_on, then: sdimu calibrate --set {path}",
        soft_wrap=True,
    )
