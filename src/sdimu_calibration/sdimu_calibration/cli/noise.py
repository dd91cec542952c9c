"""`sdimu noise`: Allan deviation of an IMU at rest, and the specification that it makes."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Annotated

import typer

from sdimu_calibration.cli.console import answer, command, plain, say
from sdimu_calibration.cli.options import BagArgument, JsonOption, results_in


def noise(
    bag: BagArgument,
    imu: Annotated[str, typer.Option(help="IMU whose grade and priors go into the new file: name or path.")] = "dtg",
    longest: Annotated[bool, typer.Option("--longest", help="The longest rest alone, not all of them.")] = False,
    seed: Annotated[int, typer.Option(min=0, help="Of the draws behind the standard errors.")] = 1,
    out: Annotated[Path | None, results_in("results; BAG_noise")] = None,
    as_json: JsonOption = False,
) -> None:
    """Find the noise terms from the rests of a recording; leaves noise.html, noise.json, imu.yaml for --imu."""
    import numpy as np

    from sdimu_calibration.cli.opened import default_folder
    from sdimu_calibration.cli.progress import bar
    from sdimu_calibration.cli.wide_table import print_table
    from sdimu_calibration.core.noise import allan, fit_terms, rests, white_noise
    from sdimu_calibration.report.noise import CHANNELS, HEAD, misfits, write_page
    from sdimu_calibration.report.noise import rows as listed
    from sdimu_calibration.storage.files.config import find_config
    from sdimu_calibration.storage.files.imu_file import write_measured_imu
    from sdimu_calibration.storage.files.noise_terms_file import write_noise_terms
    from sdimu_calibration.storage.files.whole_file import written_together
    from sdimu_calibration.storage.opening import open_recording

    find_config("imu", imu)  # errors in it are reported before the work
    recording = open_recording(bag)
    rows = rests(recording)
    if longest:
        rows = (max(rows, key=lambda r: r.stop - r.start),)
    data = np.hstack([recording.omega_ib_b, recording.f_ib_b])
    rng = np.random.default_rng(seed)
    console = plain(stderr=as_json)
    deviations, terms = {}, {}
    with bar(console) as progress:
        for k, channel in enumerate(CHANNELS):
            deviations[channel] = allan([data[r, k] for r in rows], recording.interval_s)
            terms[channel] = fit_terms(deviations[channel], rng)
            progress(channel, (k + 1) / 6)
    measured = white_noise(recording, rows)
    seconds = sum(r.stop - r.start for r in rows) * recording.interval_s
    most = max(one.tau[-1] for one in deviations.values())
    words = [
        f"{len(rows)} rest{'s' if len(rows) > 1 else ''}, {seconds:.0f} s in all, averaging times up to {most:.0f} s.",
        *misfits(terms),
        *recording.notes,
    ]
    folder = out or default_folder(bag, "noise")
    with written_together(folder) as part:
        write_noise_terms(part / "noise.json", bag.resolve().name, seconds, terms)
        write_page(part / "noise.html", deviations, terms, f"Noise of {bag.name}", words)
        write_measured_imu(part / "imu.yaml", imu, measured, terms, [f"Noise measured in {bag.name}: {words[0]}"])
    print_table(console, HEAD, listed(terms), "terms of the Allan deviation, one sigma", left=2)
    for word in words:
        say(console, f"note: {word}")
    say(console, f"note: grade and priors in imu.yaml are those of '{imu}' (--imu)")
    say(console, f"results in {folder}; to use them:")
    command(console, shlex.join(["sdimu", "calibrate", str(bag), "--imu", str(folder / "imu.yaml")]))
    answer(folder / "noise.json", as_json)
