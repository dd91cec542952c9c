"""The verb `sdimu monte-carlo`: many simulated tests, calibrated: is the estimator honest and at the bound."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from sdimu_calibration.cli.console import plain
from sdimu_calibration.cli.option_groups import with_options
from sdimu_calibration.cli.options import ModelOption
from sdimu_sim.cli.options import PlanOption, World


@dataclass(frozen=True)
class Spread:
    """Where the runs of a campaign are computed."""

    scheduler: Annotated[
        str | None,
        typer.Option(help="Address of a dask scheduler (tcp://host:8786); without it: processes on this machine."),
    ] = None
    workers: Annotated[int, typer.Option(help="Local processes.")] = 2


@with_options
def monte_carlo(
    number: Annotated[int, typer.Option("-n", "--runs", help="How many runs.")] = 100,
    out: Annotated[Path, typer.Option(help="Folder of runs and results; run again to go on where it stood.")] = Path(
        "out/monte-carlo"
    ),
    plan: PlanOption = "kim18",
    imu: Annotated[str, typer.Option(help="IMU specification: true errors are drawn from it.")] = "dtg",
    model: ModelOption = "baseline",
    seed: Annotated[int, typer.Option(help="Seed of the first run; the others follow.")] = 1,
    *,
    world: World,
    spread: Spread,
) -> None:
    """Simulate and calibrate many tests: bias, RMS against sigma and bound, NEES, NIS."""
    # Inside the function: the help of `sdimu` must not wait for numerical libraries.
    from sdimu_calibration.cli.progress import bar
    from sdimu_calibration.storage.files.config import load_model
    from sdimu_calibration.storage.files.json_file import write_json
    from sdimu_study.campaign import run_campaign
    from sdimu_study.monte_carlo import STUDY, Campaign, check, plan_bound, summarise
    from sdimu_study.monte_carlo_page import checks_table, coefficients_table, write_page

    scenario = world.scenario(plan, imu)
    case = Campaign(scenario, load_model(model))
    check(case, number, seed)
    console = plain()
    with bar(console) as progress:
        rows = run_campaign(STUDY.of(case), range(seed, seed + number), out, spread.scheduler, progress, spread.workers)
    bound = plan_bound(case, range(seed, seed + number))
    summary = summarise(rows, case.model, scenario.imu, bound, "batch least squares of this plan, IMU and mounts")
    write_json(out / "monte-carlo.json", summary)
    write_page(out / "monte-carlo.html", out / "monte-carlo.json")
    console.print(coefficients_table(summary), checks_table(summary), soft_wrap=True)
    for run in summary["failed"]:
        console.print(f"seed {run['seed']} failed: {run['error']}", soft_wrap=True, markup=False, highlight=False)
    if summary["unconverged"]:
        seeds = ", ".join(map(str, summary["unconverged"]))
        console.print(f"took all passes and may not have converged: seeds {seeds}", soft_wrap=True)
    console.print(f"results in {out}", soft_wrap=True)
