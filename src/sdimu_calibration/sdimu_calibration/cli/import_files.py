"""`sdimu import`: CSV, MAT and NPZ to a bag."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from sdimu_calibration.cli.console import plain


def import_files(
    files: Annotated[
        list[Path], typer.Argument(metavar="FILE ...", help="CSV or other columns in text, MAT up to v7, NPZ.")
    ],
    chart: Annotated[
        str, typer.Option("--map", metavar="MAP", help="What the columns are: name in config/import or path.")
    ],
    out: Annotated[Path, typer.Option(metavar="BAG", help="Folder of the bag to make.")],
    replace: Annotated[bool, typer.Option("--replace", help="Replace a bag that is already there.")] = False,
    serial: Annotated[str | None, typer.Option(metavar="NUMBER", help="Serial number of the unit.")] = None,
    power_on: Annotated[
        str | None,
        typer.Option(metavar="NAME", help="Which switch-on of the unit: recordings of one name share their biases."),
    ] = None,
) -> None:
    """Turn files of others into a recording, as a map of their columns says (doc/recordings.md)."""
    from contextlib import nullcontext

    import numpy as np

    from sdimu_calibration.storage.importing.import_map import load_import_map
    from sdimu_calibration.storage.importing.importer import read_files, write_imported

    console = plain()
    described = load_import_map(chart)
    with console.status("importing") if console.is_terminal else nullcontext():
        found = read_files(files, described)
        said = {"serial": serial, "power_on": power_on}
        write_imported(out, found, replace, {key: word for key, word in said.items() if word is not None})
    seconds = (int(found.ns.max()) - int(found.ns.min())) * 1e-9
    force = float(np.nanmedian(np.linalg.norm(found.f_ib_b, axis=1)))
    rate = np.degrees(np.nanmedian(np.linalg.norm(found.omega_ib_b, axis=1)))
    for note in found.notes:
        console.print(f"note: {note}", soft_wrap=True, markup=False, highlight=False)
    console.print(
        f"{out}: {len(found.ns)} samples, {seconds:.1f} s; half of the time |f| is below {force:.3f} m/s^2 "
        f"and |w| below {rate:.3f} deg/s",
        soft_wrap=True,
        markup=False,
        highlight=False,
    )
