"""Studies of tests that choose their turns: `sdimu study adaptive` and `adaptive-run`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from sdimu_calibration.cli.console import plain
from sdimu_study.cli.shown_campaign import check_kinds, shown_campaign


def adaptive(
    out: Annotated[Path, typer.Option(help="Folder of runs, adaptive.json, adaptive.md.")] = Path("out/study-adaptive"),
    runs: Annotated[int, typer.Option("-n", min=1, help="Tests of each kind.")] = 50,
    seed: Annotated[int, typer.Option(help="First seed.")] = 90_001,
    kind: Annotated[list[str] | None, typer.Option(help="table33, clean, hidden; repeatable. All by default.")] = None,
    plan: Annotated[list[str] | None, typer.Option(help="Fixed plan beside it; repeatable.")] = None,
    imu: Annotated[str, typer.Option(help="IMU file.")] = "dtg",
    site: Annotated[str, typer.Option(help="Site.")] = "daejeon",
    workers: Annotated[int, typer.Option(min=1, help="Processes.")] = 2,
) -> None:
    """Let tests choose their turns: minutes to the limits, do the sigmas hold, is a hidden effect told apart."""
    import math

    from sdimu_calibration.storage.files.config import load_imu, load_model, load_site
    from sdimu_calibration.storage.files.goal_file import load_goals
    from sdimu_calibration.storage.files.json_file import write_json
    from sdimu_study.adaptive_page import fixed_minutes, page
    from sdimu_study.adaptive_run import KINDS, AdaptiveRun
    from sdimu_study.hidden_sizes import sizes

    check_kinds(kind, KINDS)
    console, seeds, results = plain(), range(seed, seed + runs), {}
    place, sensor, model = load_site(site), load_imu(imu), load_model("baseline")
    seen = sizes("kim18", math.degrees(place.latitude_rad), sensor, model)
    for name in kind or KINDS:
        run = AdaptiveRun(name, sensor, place, model, load_goals("table33" if name == "table33" else "kim18"), seen)
        results[name] = shown_campaign(console, name, run, seeds, out / name, workers)
    write_json(out / "adaptive.json", results)
    fixed = {
        p: {g: fixed_minutes(p, g, place, sensor, model) for g in ("table33", "kim18")}
        for p in plan or ("kim18", "recommended")
    }
    text = page(results, fixed, seed)
    (out / "adaptive.md").write_text(text, encoding="utf-8")
    console.print(text, soft_wrap=True, markup=False, highlight=False)
    console.print(f"results in {out}", soft_wrap=True)


def adaptive_run(
    out: Annotated[Path, typer.Option(help="Folder of choices.txt and adaptive-run.png.")] = Path("out/adaptive-run"),
    goals: Annotated[str, typer.Option(help="Limits: name in config/goal or path.")] = "kim18",
    effect: Annotated[list[str] | None, typer.Option(help="Effect to hide, NAME=SIZE; repeatable.")] = None,
    seed: Annotated[int, typer.Option(help="Of coefficients, mount and noise.")] = 4,
    look: Annotated[float, typer.Option(min=10.0, help="Length of test between looks at the data (s).")] = 180.0,
) -> None:
    """Tell one adaptive test in full: each choice with its reason, how sigmas and errors fell."""
    from sdimu_calibration.core.adaptive import Menu
    from sdimu_calibration.storage.files.config import load_imu, load_model, load_plan, load_site
    from sdimu_calibration.storage.files.goal_file import load_goals
    from sdimu_calibration.storage.files.table_file import load_rate_table
    from sdimu_sim.core.scenario import Scenario, imu_truth
    from sdimu_sim.own_effects import simulated_effects
    from sdimu_study.adaptive_picture import write_picture
    from sdimu_study.adaptive_test import adaptive_test
    from sdimu_study.hidden_sizes import RATE_HZ, WARM_UP
    from sdimu_study.run import in_the_mean

    console, told, limits = plain(), list[str](), load_goals(goals)

    def tell(text: str) -> None:
        told.append(text)
        console.print(text, soft_wrap=True, markup=False, highlight=False)

    scenario = Scenario(
        load_plan("kim18"), load_imu("dtg"), load_site("daejeon"), rate_hz=RATE_HZ, seed=seed,
        effects=simulated_effects(effect or ()), temperature=WARM_UP,
    )  # fmt: skip
    sensor = imu_truth(scenario)
    table, model = load_rate_table("ideal"), load_model("baseline")
    done = adaptive_test(scenario, sensor, table, model, limits, Menu(), look, tell)
    tell(f"{done.plan.duration_s / 60.0:5.1f} min  the test ends: {done.end.reason}")
    tell(done.last.found.sentence)
    true = in_the_mean(sensor, done.last.found.fit.test.recording, seed)
    write_picture(out / "adaptive-run.png", done, limits, true)
    (out / "choices.txt").write_text("\n".join(told) + "\n", encoding="utf-8")
    console.print(f"results in {out}", soft_wrap=True)
