"""`sdimu import`: CSV, MAT and NPZ to a bag."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from sdimu_calibration.cli.console import command, plain, say
from sdimu_calibration.core.data_error import DataError
from sdimu_calibration.shell_words import joined
from sdimu_calibration.storage.files.whole_file import write_whole

if TYPE_CHECKING:
    from rich.console import Console

    from sdimu_calibration.storage.importing.importer import Imported


def import_files(
    files: Annotated[list[Path], typer.Argument(metavar="FILE ...", help="CSV or other columns in text, MAT, NPZ.")],
    chart: Annotated[
        str | None,
        typer.Option(
            "--map",
            metavar="MAP",
            help="What the columns are: name in config/import or path; left out, one is proposed.",
        ),
    ] = None,
    out: Annotated[Path | None, typer.Option(metavar="BAG", help="Folder of the bag to make.")] = None,
    each: Annotated[
        bool, typer.Option("--each", help="A bag of each file in the folder BAG, and a set file: single attitudes.")
    ] = False,
    replace: Annotated[bool, typer.Option("--replace", help="Replace a bag that is already there.")] = False,
    serial: Annotated[str | None, typer.Option(metavar="NUMBER", help="Serial number of the unit.")] = None,
    power_on: Annotated[
        str | None,
        typer.Option(metavar="NAME", help="Which switch-on of the unit: recordings of one name share their biases."),
    ] = None,
) -> None:
    """Turn files of others into a recording, as a map of their columns says (doc/recordings.md)."""
    from contextlib import nullcontext

    from sdimu_calibration.storage.importing.import_map import load_import_map
    from sdimu_calibration.storage.importing.importer import read_files, write_imported

    console = plain()
    if chart is None:
        _propose(console, files, out, each, replace)
        return
    if out is None:
        raise typer.BadParameter("name the folder of the bag to make", param_hint="--out")
    described = load_import_map(chart)
    stated = {"serial": serial, "power_on": power_on}
    said = {key: word for key, word in stated.items() if word is not None}
    if each:
        bags = [out / path.stem for path in files]
        if len(set(bags)) < len(bags):
            raise DataError("import --each: two files have one name, which both bags would have: import one by one")
        for path, bag in zip(files, bags, strict=True):
            found = read_files([path], described)
            write_imported(bag, found, replace, said)
            _tell(console, bag, found)
        _set_of(console, out, bags, replace)
        return
    with console.status("importing") if console.is_terminal else nullcontext():
        found = read_files(files, described)
        write_imported(out, found, replace, said)
    _tell(console, out, found)


def _tell(console: Console, out: Path, found: Imported) -> None:
    """Print what is in a bag."""
    import numpy as np

    seconds = (int(found.ns.max()) - int(found.ns.min())) * 1e-9
    force = float(np.nanmedian(np.linalg.norm(found.f_ib_b, axis=1)))
    rate = np.degrees(np.nanmedian(np.linalg.norm(found.omega_ib_b, axis=1)))
    for note in found.notes:
        say(console, f"note: {note}")
    say(
        console,
        f"{out}: {len(found.ns)} samples, {seconds:.1f} s; half of the time |f| is below {force:.3f} m/s^2 "
        f"and |w| below {rate:.3f} deg/s",
    )


def _set_of(console: Console, folder: Path, bags: Sequence[Path], replace: bool) -> None:
    """Write the set file of the bags, and say how to go on."""
    from sdimu_calibration.storage.recording_set import write_set

    path = folder / "set.yaml"
    write_set(path, bags, replace=replace)
    say(console, f"{path}: {len(bags)} recordings; to calibrate them together:")
    command(console, joined(["sdimu", "calibrate", "--set", str(path)]))


def _propose(console: Console, files: Sequence[Path], out: Path | None, each: bool, replace: bool) -> None:
    """Write maps that probably fit, and say how to go on."""
    from sdimu_calibration.storage.bags.file_room import check_file_room
    from sdimu_calibration.storage.importing.map_proposal import propose_maps

    folder = Path() if out is None else out.parent
    proposals = {folder / f"{files[0].stem}{one.suffix}_map.yaml": one for one in propose_maps(files)}
    # None is written where one has no room.
    for path in proposals:
        if path.exists() and not replace:
            raise DataError(f"{path}: the map is there already: use it (--map {path}), or make it anew (--replace)")
        check_file_room(path, "--out", kind="sdimu-import", replace=replace, sources=files)
    for path, proposal in proposals.items():
        write_whole(path, proposal.text)
        for line in proposal.words:
            say(console, f"note: {line}")
        bag = out or Path(f"{files[0].stem}{proposal.suffix}_bag")
        say(console, f"{path}: the map that is proposed; look at it, then:")
        words = ["sdimu", "import", *map(str, files), "--map", str(path), "--out", str(bag)]
        command(console, joined([*words, "--each"] if each else words))
