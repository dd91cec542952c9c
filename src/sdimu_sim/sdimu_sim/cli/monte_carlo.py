"""The verb `sdimu monte-carlo`: many simulated tests, calibrated: is the estimator honest and at the bound."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from sdimu_calibration.cli.console import plain
from sdimu_calibration.cli.option_groups import with_options
from sdimu_calibration.cli.options import ModelOption
from sdimu_calibration.core.recording import DataError
from sdimu_sim.cli.options import PlanOption, World

if TYPE_CHECKING:
    from sdimu_sim.campaign.run import CalibrationRun


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
    from sdimu_calibration.report.monte_carlo import checks_table, coefficients_table, write_page
    from sdimu_calibration.storage.config import load_model
    from sdimu_calibration.storage.json_file import write_json
    from sdimu_sim.campaign.bound import plan_bound
    from sdimu_sim.campaign.campaign import run_campaign
    from sdimu_sim.campaign.run import CalibrationRun
    from sdimu_sim.campaign.summary import summarise

    scenario = world.scenario(plan, imu)
    work = CalibrationRun(scenario, load_model(model))
    check_options(work, number, seed)
    console = plain()
    with bar(console) as progress:
        rows = run_campaign(work, range(seed, seed + number), out, spread.scheduler, progress, spread.workers)
    bound = plan_bound(work, range(seed, seed + number))
    summary = summarise(rows, work.model, scenario.imu, bound, "batch least squares of this plan, IMU and mounts")
    write_json(out / "monte-carlo.json", summary)
    write_page(out / "monte-carlo.html", out / "monte-carlo.json")
    console.print(coefficients_table(summary), checks_table(summary), soft_wrap=True)
    for run in summary["failed"]:
        console.print(f"seed {run['seed']} failed: {run['error']}", soft_wrap=True, markup=False, highlight=False)
    if summary["unconverged"]:
        seeds = ", ".join(map(str, summary["unconverged"]))
        console.print(f"took all passes and may not have converged: seeds {seeds}", soft_wrap=True)
    console.print(f"results in {out}", soft_wrap=True)


def check_options(work: CalibrationRun, number: int, seed: int) -> None:
    """Refuse what would make every run fail.

    Raises
    ------
    DataError
        When the number of runs, the seed, the rate, an effect or the model cannot be used.
    """
    from sdimu_calibration.core.alignment.prepared import set_up
    from sdimu_sim.core.hidden import parse_effects

    if number < 2:
        raise DataError(f"-n {number}: expected at least 2 runs")
    if seed < 0:
        raise DataError(f"--seed {seed}: expected a whole number from 0")
    if not 10.0 <= work.scenario.rate_hz <= 1000.0:
        raise DataError(f"--rate {work.scenario.rate_hz:g} Hz: expected 10 to 1000 Hz")
    if parse_effects(work.scenario.effects).needs_temperature and work.scenario.temperature is None:
        raise DataError("a hidden effect needs the temperature: give --temperature")
    set_up(work.scenario.site, work.scenario.imu, work.model)
