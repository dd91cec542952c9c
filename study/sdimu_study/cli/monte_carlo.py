"""The verb `sdimu monte-carlo`: many simulated tests, calibrated: is the estimator honest and at the bound."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated

import typer

from sdimu_calibration.cli.console import plain
from sdimu_sim.cli.simulate import EFFECT, TEMPERATURE

_SCHEDULER = "Address of a dask scheduler (tcp://host:8786); without it: processes on this machine."


def monte_carlo(
    number: Annotated[int, typer.Option("-n", "--runs", help="How many runs.")] = 100,
    out: Annotated[Path, typer.Option(help="Folder of runs and results; run again to go on where it stood.")] = Path(
        "out/monte-carlo"
    ),
    plan: Annotated[str, typer.Option(help="Test plan: name in config/plan or path.")] = "kim18",
    imu: Annotated[str, typer.Option(help="IMU specification: true errors are drawn from it.")] = "dtg",
    model: Annotated[str, typer.Option(help="Model to estimate: name in config/model or path.")] = "baseline",
    site: Annotated[str, typer.Option(help="Site.")] = "daejeon",
    table: Annotated[str, typer.Option(help="Rate table.")] = "ideal",
    rate: Annotated[float, typer.Option(help="Sample rate of the IMU (Hz), 10 to 1000.")] = 100.0,
    seed: Annotated[int, typer.Option(help="Seed of the first run; the others follow.")] = 1,
    mount: Annotated[str | None, typer.Option(help="Rotation of the IMU on the table: 'X,Y,Z' (deg).")] = None,
    mount_max: Annotated[float, typer.Option(help="Without --mount: drawn up to this about every axis (deg).")] = 3.0,
    effect: Annotated[list[str] | None, typer.Option(help=EFFECT)] = None,
    temperature: Annotated[str | None, typer.Option(help=TEMPERATURE)] = None,
    scheduler: Annotated[str | None, typer.Option(help=_SCHEDULER)] = None,
    workers: Annotated[int, typer.Option(help="Local processes.")] = 2,
) -> None:
    """Simulate and calibrate many tests: bias, RMS against sigma and bound, NEES, NIS."""
    # Inside the function: the help of `sdimu` must not wait for numerical libraries.

    from rate_table_sim.table_file import load_table
    from sdimu_calibration.cli.progress import bar
    from sdimu_calibration.storage.files.config import load_imu, load_model, load_plan, load_site
    from sdimu_calibration.storage.files.json_file import write_json
    from sdimu_sim.cli.simulate import mount_rad
    from sdimu_sim.core.scenario import Scenario
    from sdimu_sim.own_effects import simulated_effects
    from sdimu_sim.temperature_file import load_temperature
    from sdimu_study.campaign import run_campaign
    from sdimu_study.monte_carlo import STUDY, Campaign, check, plan_bound, summarise
    from sdimu_study.monte_carlo_page import checks_table, coefficients_table, write_page

    scenario = Scenario(
        plan=load_plan(plan),
        imu=load_imu(imu),
        site=load_site(site),
        table=load_table(table),
        rate_hz=rate,
        mount_rad=None if mount is None else mount_rad(mount),
        mount_max_rad=math.radians(mount_max),
        effects=simulated_effects(effect or ()),
        temperature=None if temperature is None else load_temperature(temperature),
    )
    case = Campaign(scenario, load_model(model))
    check(case, number, seed)
    console = plain()
    with bar(console) as progress:
        rows = run_campaign(STUDY.of(case), range(seed, seed + number), out, scheduler, progress, workers)
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
