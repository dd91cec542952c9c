"""The verb `sdimu hidden-campaign`: hide effects at random, diagnose, score by name."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from sdimu_calibration.cli.console import plain

_KIND = "Kind of draw: weak, strong, pair, clean, outside or noise; repeatable; all of them without it."
_SCHEDULER = "Address of a dask scheduler (tcp://host:8786); without it: processes on this machine."


def hidden_campaign(
    number: Annotated[int, typer.Option("-n", "--runs", help="How many runs of each kind.")] = 30,
    kind: Annotated[list[str] | None, typer.Option(help=_KIND)] = None,
    out: Annotated[Path, typer.Option(help="Folder of runs and results; run again to go on where it stood.")] = Path(
        "out/hidden-campaign"
    ),
    imu: Annotated[str, typer.Option(help="IMU specification: true errors are drawn from it.")] = "dtg",
    model: Annotated[str, typer.Option(help="Model that is to be found wanting.")] = "baseline",
    seed: Annotated[int, typer.Option(help="Seed of the first run of each kind; the others follow.")] = 1,
    scheduler: Annotated[str | None, typer.Option(help=_SCHEDULER)] = None,
    workers: Annotated[int, typer.Option(help="Local processes.")] = 2,
) -> None:
    """Hide effects at random, diagnose the recordings blindly, and score the findings by name."""
    # Inside the function: the help of `sdimu` must not wait for numerical libraries.
    from sdimu_calibration.cli.progress import bar
    from sdimu_calibration.storage.files.config import load_imu, load_model
    from sdimu_calibration.storage.files.json_file import write_json
    from sdimu_calibration.storage.files.whole_file import write_whole
    from sdimu_study.campaign import run_campaign
    from sdimu_study.hidden import STUDY, HiddenCase
    from sdimu_study.hidden_draw import KINDS, LATITUDES_DEG, sizes
    from sdimu_study.hidden_page import page, summarise
    from sdimu_study.plans import FILED

    kinds = tuple(kind or KINDS)
    check_options(kinds, KINDS, number, seed)
    console = plain()
    specification, baseline = load_imu(imu), load_model(model)
    with bar(console) as progress:
        tables = []
        for k, (plan, latitude) in enumerate((p, x) for p in FILED for x in LATITUDES_DEG):
            progress(f"sizes on {plan} at {latitude:.0f} deg", k / (len(FILED) * len(LATITUDES_DEG)))
            tables.append(sizes(plan, latitude, specification, baseline))
    rows = []
    for word in kinds:
        work = STUDY.of(HiddenCase(word, specification, baseline, tuple(tables)))
        console.print(f"{word}:")
        with bar(console) as progress:
            rows += run_campaign(work, range(seed, seed + number), out, scheduler, progress, workers)
    summary = summarise(rows) | {"first_seed": seed}
    write_json(out / "hidden-effects.json", summary)
    write_whole(out / "hidden-effects.md", page(summary))
    for figure in summary["figures"]:
        if figure["value"] is not None:
            judged = f"{figure['value']:.3f} ({figure['of']} runs; wanted {figure['wanted']})"
            console.print(f"{figure['name']}: {judged}", soft_wrap=True)
    console.print(f"results in {out}", soft_wrap=True)


def check_options(kinds: Sequence[str], known: Sequence[str], number: int, seed: int) -> None:
    """Refuse what cannot be run."""
    from sdimu_calibration.core.recording import DataError

    for word in kinds:
        if word not in known:
            raise DataError(f"--kind {word}: expected one of {', '.join(known)}")
    if number < 1:
        raise DataError(f"-n {number}: expected at least 1 run")
    if seed < 0:
        raise DataError(f"--seed {seed}: expected a whole number from 0")
