"""`sdimu noise`: Allan deviation of an IMU at rest, and the specification that it makes."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from sdimu_calibration.cli.console import answer, command, plain, say
from sdimu_calibration.cli.opened import default_folder
from sdimu_calibration.cli.option_groups import with_options
from sdimu_calibration.cli.options import BagArgument, JsonOption, Recorded, SerialOption, results_in
from sdimu_calibration.cli.progress import bar
from sdimu_calibration.cli.wide_table import print_table
from sdimu_calibration.core.units import from_si
from sdimu_calibration.shell_words import joined
from sdimu_calibration.storage.files.whole_file import written_together

if TYPE_CHECKING:
    from rich.console import Console

    from sdimu_calibration.core.noise import Allan, Terms
    from sdimu_calibration.core.recording import Recording
    from sdimu_calibration.core.specification import Site

MEASURED = "Noise measured in"
"""How the remark begins at the head of imu.yaml: such a file may be replaced by a new one."""


@with_options
def noise(
    bag: BagArgument,
    opening: Recorded,
    longest: Annotated[bool, typer.Option("--longest", help="The longest rest alone, not all of them.")] = False,
    seed: Annotated[int, typer.Option(min=0, help="Of the draws behind the standard errors.")] = 1,
    serial: SerialOption = None,
    out: Annotated[Path | None, results_in("results; BAG_noise")] = None,
    as_json: JsonOption = False,
) -> None:
    """Find the noise terms from the rests of a recording; leaves noise.html, noise.json, imu.yaml for --imu."""
    from sdimu_calibration.core.noise import rests, white_noise
    from sdimu_calibration.core.origin import measured as measured_origin
    from sdimu_calibration.report.noise import HEAD, misfits, no_rest, write_page
    from sdimu_calibration.report.noise import rows as listed
    from sdimu_calibration.storage.bags.file_room import check_own_file
    from sdimu_calibration.storage.files.config import find_config, load_imu, load_site
    from sdimu_calibration.storage.files.imu_file import write_measured_imu
    from sdimu_calibration.storage.files.noise_terms_file import write_noise_terms
    from sdimu_calibration.storage.opening import open_recording, said_of

    # Errors in files are reported before the work.
    folder = out or default_folder(bag, "noise")
    stated = []
    if opening.imu is not None:
        load_imu(opening.imu)
        stated = [find_config("imu", opening.imu)]
    check_own_file(folder / "imu.yaml", (f"# {MEASURED}",), stated)
    site = None if opening.site is None else load_site(opening.site)
    recording = open_recording(bag, opening.source)
    imu = opening.imu or grade_of(recording)
    rows = rests(recording)
    if longest:
        rows = (max(rows, key=lambda r: r.stop - r.start),)
    console = plain(stderr=as_json)
    deviations, terms = _terms(console, recording, rows, seed)
    measured = white_noise(recording, rows)
    seconds = sum(r.stop - r.start for r in rows) * recording.interval_s
    most = max(one.tau[-1] for one in deviations.values())
    words = [
        f"{len(rows)} rest{'s' if len(rows) > 1 else ''}, {seconds:.0f} s in all, averaging times up to {most:.0f} s.",
        *filter(None, [no_rest(terms)]),
        *misfits(terms),
        *([] if site is None else [gravity_note(recording, rows, site)]),
        *recording.notes,
    ]
    place = [] if opening.site is None else ["--site", opening.site]
    with written_together(folder) as part:
        origin = measured_origin(said_of(bag, opening.site or ""), recording, load_imu(imu).name)
        write_noise_terms(part / "noise.json", bag.resolve().name, seconds, terms, origin.stated(serial, None))
        write_page(part / "noise.html", deviations, terms, f"Noise of {bag.name}", words)
        write_measured_imu(part / "imu.yaml", imu, measured, terms, _head(bag, words[0], no_rest(terms)))
    print_table(console, HEAD, listed(terms), "terms of the Allan deviation, one sigma", left=2)
    for word in words:
        say(console, f"note: {word}")
    told = "--imu" if opening.imu is not None else "proposed by the rests; --imu states another"
    say(console, f"note: grade and priors in imu.yaml are those of '{imu}' ({told})")
    say(console, f"results in {folder}; to use them:")
    command(console, joined(["sdimu", "calibrate", str(bag), "--imu", str(folder / "imu.yaml"), *place]))
    answer(folder / "noise.json", as_json)


def _head(bag: Path, rests: str, no_rest: str) -> list[str]:
    """Remarks at the head of imu.yaml; one a line."""
    return [f"{MEASURED} {bag.name}: {rests}", *filter(None, [no_rest])]


def _terms(
    console: Console, recording: Recording, rows: Sequence[slice], seed: int
) -> tuple[dict[str, Allan], dict[str, Terms]]:
    """Allan deviation and noise terms of each channel."""
    import numpy as np

    from sdimu_calibration.core.noise import allan, fit_terms
    from sdimu_calibration.report.noise import CHANNELS

    data = np.hstack([recording.omega_ib_b, recording.f_ib_b])
    rng = np.random.default_rng(seed)
    deviations, terms = {}, {}
    with bar(console) as progress:
        for k, channel in enumerate(CHANNELS):
            deviations[channel] = allan([data[r, k] for r in rows], recording.interval_s)
            terms[channel] = fit_terms(deviations[channel], rng)
            progress(channel, (k + 1) / 6)
    return deviations, terms


def grade_of(recording: Recording) -> str:
    """Name the IMU file that the rests of a recording propose."""
    from sdimu_calibration.core.data.imu_class import propose
    from sdimu_calibration.storage.files.config import load_imu
    from sdimu_calibration.storage.opening import CLASSES

    return propose(recording, tuple(map(load_imu, CLASSES)))[0].name


def gravity_note(recording: Recording, rows: Sequence[slice], site: Site) -> str:
    """Hold the force at rest against gravity of the site."""
    import numpy as np

    from sdimu_calibration.core import earth

    gravity = site.gravity_m_s2 or float(earth.normal_gravity(site.latitude_rad, site.height_m))
    size = float(np.mean([np.linalg.norm(recording.f_ib_b[r].mean(axis=0)) for r in rows]))
    return (
        f"|f| at rest is {size:.5f} m/s^2, {from_si(size - gravity, 'mg'):+.3g} mg from gravity of the site "
        f"({gravity:.5f} m/s^2)"
    )
