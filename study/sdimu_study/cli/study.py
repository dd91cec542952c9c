"""The verb `sdimu study`: questions to the method that need many simulated tests."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from sdimu_calibration.cli.console import plain
from sdimu_study.cli.adaptive_study import adaptive, adaptive_run
from sdimu_study.cli.shown_campaign import check_kinds, imu_files, leave_page, shown_campaign

app = typer.Typer(help="Put a claim of the method to the test, by simulation.", no_args_is_help=True)
app.command()(adaptive)
app.command()(adaptive_run)


@app.callback()
def _studies() -> None:
    """Put a claim of the method to the test, by simulation."""


@app.command()
def mount(
    out: Annotated[Path, typer.Option(help="Folder of mount.json and mount.html.")] = Path("out/study-mount"),
    seeds: Annotated[int, typer.Option(min=1, help="IMUs a mount; seeds 1 to this.")] = 10,
    largest: Annotated[int, typer.Option(min=0, max=45, help="Largest mount (deg), in steps of one.")] = 5,
    plan: Annotated[str, typer.Option(help="Test plan: name in config/plan or path.")] = "kim18",
    imu: Annotated[str, typer.Option(help="IMU specification: name in config/imu or path.")] = "dtg",
    model: Annotated[str, typer.Option(help="Model to estimate.")] = "baseline",
    site: Annotated[str, typer.Option(help="Site.")] = "daejeon",
) -> None:
    """Draw error against mount misalignment for the filter and the classical estimator."""
    # Inside the function: the help of `sdimu` must not wait for numerical libraries.
    from rich.box import SIMPLE
    from rich.table import Table

    from sdimu_calibration.cli.progress import bar
    from sdimu_calibration.core.effects.imu_model import build
    from sdimu_calibration.core.units import from_si
    from sdimu_calibration.storage.files.config import load_imu, load_model, load_plan, load_site
    from sdimu_calibration.storage.files.json_file import write_json
    from sdimu_sim.core.scenario import Scenario
    from sdimu_study.mount_page import write_page
    from sdimu_study.mount_study import mount_study

    console = plain()
    wanted, specification = load_model(model), load_imu(imu)
    scenario = Scenario(load_plan(plan), specification, load_site(site))
    mounts = [float(m) for m in range(largest + 1)]
    with bar(console) as progress:
        content = mount_study(scenario, wanted, mounts, range(1, seeds + 1), progress)
    units = {e.name: e.parameters[0].display_unit for e in build(wanted.effects, specification).effects}
    write_json(out / "mount.json", content)
    write_page(out / "mount.html", content, units)
    for estimator, by_effect in content["rms"].items():
        table = Table("RMS error", *(f"{m:g} deg" for m in mounts), "unit", title=estimator, box=SIMPLE)
        for effect, unit in units.items():
            table.add_row(effect, *(f"{from_si(float(v), unit):.3g}" for v in by_effect[effect]), unit)
        console.print(table)
    console.print(f"results in {out}", soft_wrap=True)


@app.command()
def faults(
    out: Annotated[Path, typer.Option(help="Folder of faults.json and faults.md.")] = Path("out/study-faults"),
    seeds: Annotated[int, typer.Option(min=1, help="Tests a fault and size; seeds 1 to this.")] = 3,
    only: Annotated[list[str] | None, typer.Option(help="Kind of fault; repeatable. All by default.")] = None,
    plan: Annotated[str, typer.Option(help="Test plan, done in a hurry: name or path.")] = "kim18_signed",
    imu: Annotated[str, typer.Option(help="IMU specification: name in config/imu or path.")] = "dtg",
    model: Annotated[str, typer.Option(help="Model to estimate.")] = "baseline",
    site: Annotated[str, typer.Option(help="Site.")] = "daejeon",
) -> None:
    """Spoil tests with every kind of fault at five sizes: none may end silently wrong. Exit status 1 if one does."""
    from rich.box import SIMPLE
    from rich.table import Table

    from sdimu_calibration.cli.progress import bar
    from sdimu_calibration.core.recording import DataError
    from sdimu_calibration.storage.files.config import load_imu, load_model, load_plan, load_site
    from sdimu_calibration.storage.files.json_file import write_json
    from sdimu_sim.core.faults import FAULTS
    from sdimu_sim.core.scenario import Scenario
    from sdimu_study.fault_page import page
    from sdimu_study.fault_run import TRACEBACK, WRONG
    from sdimu_study.fault_study import content, fault_study, hurried, table, totals

    known = {fault.name: fault for fault in FAULTS}
    unknown = sorted(set(only or ()) - set(known))
    if unknown:
        raise DataError(f"--only {unknown[0]}: expected one of {', '.join(known)}")
    console = plain()
    scenario = Scenario(hurried(load_plan(plan)), load_imu(imu), load_site(site))
    chosen = [known[name] for name in only] if only else list(FAULTS)
    with bar(console) as progress:
        outcomes = fault_study(scenario, load_model(model), range(1, seeds + 1), chosen, progress)
    write_json(out / "faults.json", content(outcomes))
    (out / "faults.md").write_text(page(outcomes), encoding="utf-8")
    shown = Table("fault", "1", "2", "3", "4", "5", box=SIMPLE)
    for name, _, cells in table(outcomes):
        shown.add_row(name, *cells)
    console.print(shown)
    ended = totals(outcomes)
    console.print(", ".join(f"{n} {verdict}" for verdict, n in ended.items()), highlight=False)
    for o in outcomes:
        if o.verdict in {WRONG, TRACEBACK}:
            console.print(f"{o.fault} {o.size:g}, seed {o.seed}: {o.verdict} {o.worst:.2f} {o.said}", soft_wrap=True)
    console.print(f"results in {out}", soft_wrap=True)
    if {WRONG, TRACEBACK} & set(ended):
        raise typer.Exit(1)


@app.command()
def grades(
    out: Annotated[Path, typer.Option(help="Folder of runs, grades.json, grades.md.")] = Path("out/study-grades"),
    runs: Annotated[int, typer.Option("-n", min=1, help="Clean tests, and tests with an effect, of each file.")] = 30,
    seed: Annotated[int, typer.Option(help="First seed.")] = 50_001,
    draws: Annotated[int, typer.Option(min=0, help="Tests of each file and plan whose estimator is noted.")] = 50,
    imu: Annotated[list[str] | None, typer.Option(help="IMU file; repeatable. All of config/imu by default.")] = None,
    workers: Annotated[int, typer.Option(min=1, help="Processes.")] = 2,
) -> None:
    """Diagnose clean tests and tests with one hidden effect of every IMU file."""
    from sdimu_study.grade_page import page
    from sdimu_study.grade_run import HANDHELD, PLANS, GradeRun, choice

    names = imu_files(imu)
    console, seeds = plain(), range(seed, seed + runs)
    clean, hidden, choices = {}, {}, {}
    for name in names:
        folder = out / name
        clean[name] = shown_campaign(console, name, GradeRun(name, False), seeds, folder / "clean", workers)
        hidden[name] = shown_campaign(console, name, GradeRun(name, True), seeds, folder / "hidden", workers)
        plans = PLANS[:1] if name == HANDHELD else PLANS
        choices[name] = [
            {"plan": plan, "estimator": choice(name, plan, seed + k)} for plan in plans for k in range(draws)
        ]
    rows = {"clean": clean, "hidden": hidden, "choices": choices}
    leave_page(console, out / "grades", rows, page(clean, hidden, choices, seed))


@app.command()
def clean(
    out: Annotated[Path, typer.Option(help="Folder of runs, clean.json, clean.md.")] = Path("out/study-clean"),
    runs: Annotated[int, typer.Option("-n", min=1, help="Tests of each IMU file and plan.")] = 17,
    seed: Annotated[int, typer.Option(help="First seed.")] = 55_001,
    imu: Annotated[list[str] | None, typer.Option(help="IMU file; repeatable. All of config/imu by default.")] = None,
    workers: Annotated[int, typer.Option(min=1, help="Processes.")] = 2,
) -> None:
    """Diagnose tests with nothing hidden in them: every IMU file on plans from six positions to random attitudes."""
    from sdimu_study.clean_page import page
    from sdimu_study.clean_run import CleanRun, plans_of

    names = imu_files(imu)
    console, seeds = plain(), range(seed, seed + runs)
    results = {}
    for name in names:
        for plan in plans_of(name):
            work, folder = CleanRun(name, plan), out / name / plan.replace(" ", "_")
            results[name, plan] = shown_campaign(console, f"{name}, {plan}", work, seeds, folder, workers)
    leave_page(console, out / "clean", {" ".join(key): rows for key, rows in results.items()}, page(results, seed))


@app.command()
def noise(
    out: Annotated[Path, typer.Option(help="Folder of runs, noise.json, noise.md.")] = Path("out/study-noise"),
    runs: Annotated[int, typer.Option("-n", min=1, help="Tests of each IMU file and kind of noise.")] = 40,
    seed: Annotated[int, typer.Option(help="First seed.")] = 60_001,
    imu: Annotated[list[str] | None, typer.Option(help="IMU file; repeatable. All on a table by default.")] = None,
    kind: Annotated[list[str] | None, typer.Option(help="Kind of noise; repeatable. All by default.")] = None,
    sigmas: Annotated[
        float, typer.Option(min=0.0, help="Hide one effect of so many sigma, as the test sees it in the true noise.")
    ] = 0.0,
    workers: Annotated[int, typer.Option(min=1, help="Processes.")] = 2,
) -> None:
    """Diagnose tests in noise with a memory: are terms named with their size, do the sigmas hold."""
    from sdimu_sim.core.coloured import KINDS
    from sdimu_study.grade_run import HANDHELD
    from sdimu_study.noise_page import page
    from sdimu_study.noise_run import NoiseRun

    known = ("white", *KINDS)
    check_kinds(kind, known)
    names = imu_files(imu, without=HANDHELD)
    console, seeds = plain(), range(seed, seed + runs)
    results = {}
    for name in names:
        for one in kind or known:
            work, folder = NoiseRun(name, one, sigmas), out / name / one
            results[name, one] = shown_campaign(console, f"{name}, {one}", work, seeds, folder, workers)
    leave_page(console, out / "noise", {" ".join(key): rows for key, rows in results.items()}, page(results, seed))


@app.command()
def missing(
    out: Annotated[Path, typer.Option(help="Folder of runs, missing.json, missing.md.")] = Path("out/study-missing"),
    runs: Annotated[int, typer.Option("-n", min=1, help="Tests of each effect.")] = 10,
    seed: Annotated[int, typer.Option(help="First seed.")] = 65_001,
    imu: Annotated[str, typer.Option(help="IMU file of a rate table, in config/imu.")] = "dtg",
    effect: Annotated[list[str] | None, typer.Option(help="Effect; repeatable. All by default.")] = None,
    workers: Annotated[int, typer.Option(min=1, help="Processes.")] = 2,
) -> None:
    """Diagnose tests as if the catalogue lacked what is hidden in them: is that seen, do the sigmas hold."""
    from sdimu_calibration.core.effects import registry
    from sdimu_calibration.core.recording import DataError
    from sdimu_sim.core.hidden import effect_names
    from sdimu_study.grade_run import HANDHELD
    from sdimu_study.missing_page import page
    from sdimu_study.missing_run import MissingRun

    shown = frozenset(effect_names())
    known = [n for n in registry.names() if any(p.name in shown for p in registry.get(n).parameters)]
    known = [n for n in known if registry.get(n).needs != "temperature"]
    unknown = sorted(set(effect or ()) - set(registry.names()))
    if unknown:
        whole = [n for n in registry.names() if unknown[0] in {p.name for p in registry.get(n).parameters}]
        raise DataError(
            f"--effect {unknown[0]}: " + (f"a coefficient of {whole[0]}; name that" if whole
                                          else "no effect of the catalogue; sdimu effects lists them")
        )  # fmt: skip
    (imu,) = imu_files([imu], without=HANDHELD)
    console, seeds, results = plain(), range(seed, seed + runs), {}
    for name in effect or known:
        results[name] = shown_campaign(console, name, MissingRun(imu, name), seeds, out / name, workers)
    leave_page(console, out / "missing", results, page(imu, results, seed))


@app.command()
def many(
    out: Annotated[Path, typer.Option(help="Folder of runs and many.json.")] = Path("out/study-many"),
    runs: Annotated[int, typer.Option("-n", min=1, help="Tests of each IMU file.")] = 50,
    seed: Annotated[int, typer.Option(help="First seed.")] = 67_001,
    imu: Annotated[
        list[str] | None,
        typer.Option(help="IMU file of a rate table; repeatable. dtg, rlg_navigation by default."),
    ] = None,
    workers: Annotated[int, typer.Option(min=1, help="Processes.")] = 2,
) -> None:
    """Diagnose tests with five to twelve effects of 3 to 50 sigma at once."""
    import numpy as np
    from rich.box import SIMPLE
    from rich.table import Table

    from sdimu_calibration.storage.files.json_file import write_json
    from sdimu_study.grade_run import HANDHELD
    from sdimu_study.many_run import ManyRun

    console, seeds, results = plain(), range(seed, seed + runs), {}
    for name in imu_files(imu or ["dtg", "rlg_navigation"], without=HANDHELD):
        results[name] = shown_campaign(console, name, ManyRun(name), seeds, out / name, workers)
    write_json(out / "many.json", results)
    headings = ("IMU file", "runs", "8 sigma or more, named", "5 to 8", "below", "wrong names", "RMS z", "s")
    table = Table(*headings, box=SIMPLE)
    for name, rows in results.items():
        good = [row for row in rows if "error" not in row]
        hits = [effect for row in good for effect in row["effects"]]
        cells = [
            f"{sum(e['named'] for e in part)} of {len(part)}"
            for low, high in ((8.0, np.inf), (5.0, 8.0), (0.0, 5.0))
            for part in [[e for e in hits if low <= e["sigmas"] < high]]
        ]
        wrong, found = sum(len(row["wrong"]) for row in good), sum(row["found"] for row in good)
        z = np.sqrt(sum(row["z2"] for row in good) / max(1, sum(row["count"] for row in good)))
        seconds = np.median([row["seconds"] for row in good]) if good else np.nan
        table.add_row(name, f"{len(good)} of {len(rows)}", *cells, f"{wrong} of {found}", f"{z:.2f}", f"{seconds:.0f}")
    console.print(table)
    console.print(f"results in {out}", soft_wrap=True)


@app.command()
def sets(
    out: Annotated[Path, typer.Option(help="Folder of runs and sets.json.")] = Path("out/study-sets"),
    runs: Annotated[int, typer.Option("-n", min=1, help="Sets of each kind.")] = 20,
    seed: Annotated[int, typer.Option(help="First seed.")] = 71_001,
    kind: Annotated[list[str] | None, typer.Option(help="Kind of set, such as weak or soaks; repeatable. All.")] = None,
    imu: Annotated[str, typer.Option(help="IMU file.")] = "dtg",
    workers: Annotated[int, typer.Option(min=1, help="Processes.")] = 2,
) -> None:
    """Fit and diagnose sets of recordings of one unit; soaks: every coefficient a polynomial of the temperature."""
    from rich.box import SIMPLE
    from rich.table import Table

    from sdimu_calibration.storage.files.json_file import write_json
    from sdimu_study import soak_page
    from sdimu_study.grade_run import HANDHELD
    from sdimu_study.set_page import headings, line
    from sdimu_study.set_run import KINDS, SetRun
    from sdimu_study.soak_run import SOAK_KINDS, SoakRun

    known = (*KINDS, *SOAK_KINDS)
    check_kinds(kind, known)
    (imu,) = imu_files([imu], without=HANDHELD)
    console, seeds, results = plain(), range(seed, seed + runs), {}
    for name in kind or known:
        work = SoakRun(name, imu) if name in SOAK_KINDS else SetRun(name, imu)
        results[name] = shown_campaign(console, name, work, seeds, out / name, workers)
    write_json(out / "sets.json", results)
    table = Table(*headings(), box=SIMPLE)
    for name, rows in results.items():
        if name in KINDS:
            table.add_row(*line(name, rows))
    if table.rows:
        console.print(table)
    for name, rows in results.items():
        if name in SOAK_KINDS:
            for one in soak_page.tables(name, rows):
                shown = Table(*one[0], box=SIMPLE)
                for cells in one[1:]:
                    shown.add_row(*cells)
                console.print(shown)
    console.print(f"results in {out}", soft_wrap=True)


@app.command()
def hand(
    out: Annotated[Path, typer.Option(help="Folder of runs and hand.json.")] = Path("out/study-hand"),
    runs: Annotated[int, typer.Option("-n", min=1, help="Clean runs, and as many with a hidden effect.")] = 100,
    seed: Annotated[int, typer.Option(help="First seed.")] = 69_001,
    workers: Annotated[int, typer.Option(min=1, help="Processes.")] = 2,
) -> None:
    """Diagnose runs by hand of any grade and rate, with bias instability and rests that somebody nudges."""
    import numpy as np
    from rich.box import SIMPLE
    from rich.table import Table

    from sdimu_calibration.storage.files.json_file import write_json
    from sdimu_study.hand_run import IMUS, HandRun

    console, seeds, results = plain(), range(seed, seed + runs), {}
    for word, hidden in (("clean", False), ("hidden", True)):
        results[word] = shown_campaign(console, word, HandRun(hidden), seeds, out / word, workers)
    write_json(out / "hand.json", results)
    headings = ("IMU file", "clean runs", "consistent", "RMS z", "hidden runs", "in a class", "first", "RMS z")
    table = Table(*headings, box=SIMPLE)
    for name in (*IMUS, "all"):
        cells = []
        for word, found in results.items():
            rows = [r for r in found if "error" not in r and name in (r["imu"], "all")]
            z = np.sqrt(sum(r["z2"] for r in rows) / max(1, sum(r["count"] for r in rows)))
            said = ("in_class", "first") if word == "hidden" else ("consistent",)
            hits = [sum(bool(r.get(s, r["verdict"] == s)) for r in rows) for s in said]
            cells += [str(len(rows)), *map(str, hits), f"{z:.2f}"]
        table.add_row(name, *cells)
    console.print(table)
    refused = [r["error"] for rows in results.values() for r in rows if "error" in r]
    console.print(f"refused: {len(refused)}", *sorted(set(refused))[:5], sep="\n", markup=False)
    console.print(f"results in {out}", soft_wrap=True)
