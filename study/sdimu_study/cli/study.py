"""The verb `sdimu study`: questions to the method that need many simulated tests."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from sdimu_calibration.cli.console import plain
from sdimu_study.cli.conduct import check_kinds, conduct, conduct_as_table, imu_files, leave

if TYPE_CHECKING:
    from sdimu_study.study import Key, Row

app = typer.Typer(
    help="Put a claim of the method to the test, by simulation.", no_args_is_help=True, add_completion=False
)

Seed = Annotated[int, typer.Option(help="First seed.")]
Workers = Annotated[int, typer.Option(min=1, help="Processes.")]
Imus = Annotated[list[str] | None, typer.Option(help="IMU file; repeatable. All of config/imu by default.")]
Imu = Annotated[str, typer.Option(help="IMU file.")]
Place = Annotated[str, typer.Option(help="Site.")]
Specification = Annotated[str, typer.Option(help="IMU specification: name in config/imu or path.")]
Wanted = Annotated[str, typer.Option(help="Model to estimate.")]


@app.callback()
def _studies() -> None:
    """Put a claim of the method to the test, by simulation."""


@app.command()
def adaptive(
    out: Annotated[Path, typer.Option(help="Folder of runs, adaptive.json, adaptive.md.")] = Path("out/study-adaptive"),
    runs: Annotated[int, typer.Option("-n", min=1, help="Tests of each kind.")] = 50,
    seed: Seed = 90_001,
    kind: Annotated[
        list[str] | None, typer.Option(help="table33, clean, hidden, wide, 'wide hidden'; repeatable. All by default.")
    ] = None,
    plan: Annotated[list[str] | None, typer.Option(help="Fixed plan beside it; repeatable.")] = None,
    imu: Annotated[str, typer.Option(help="IMU file; the wide tests take four grades.")] = "dtg",
    site: Annotated[str, typer.Option(help="Site; the wide tests draw theirs.")] = "daejeon",
    workers: Workers = 2,
) -> None:
    """Let tests choose their turns: minutes to the limits, do the sigmas hold, is a hidden effect told apart."""
    # Inside the functions: the help of `sdimu` must not wait for numerical libraries.
    import math

    from sdimu_calibration.storage.files.config import load_imu, load_model, load_site
    from sdimu_calibration.storage.files.goal_file import load_goals
    from sdimu_study.adaptive import FIXED, GOALS, IMUS, KINDS, STUDY, AdaptiveCase, WideCase, fixed_minutes, page
    from sdimu_study.hidden_draw import sizes

    check_kinds(kind, KINDS)
    place, sensor, model = load_site(site), load_imu(imu), load_model("baseline")
    seen = sizes("kim18", math.degrees(place.latitude_rad), sensor, model)
    cases: dict[Key, AdaptiveCase | WideCase] = {}
    for name in kind or KINDS:
        if name.startswith("wide"):
            cases |= {(name, of): WideCase(of, name == "wide hidden") for of in IMUS}
        else:
            goals = load_goals("table33" if name == "table33" else "kim18")
            cases[(name,)] = AdaptiveCase(name, sensor, place, model, goals, seen)
    results = conduct(STUDY, cases, range(seed, seed + runs), out, workers)
    fixed = {p: {g: fixed_minutes(p, g, place, sensor, model) for g in GOALS} for p in plan or FIXED}
    leave(out / "adaptive", results, page(results, fixed, seed))


@app.command()
def adaptive_run(
    out: Annotated[Path, typer.Option(help="Folder of choices.txt and adaptive-run.png.")] = Path("out/adaptive-run"),
    goals: Annotated[str, typer.Option(help="Limits: name in config/goal or path.")] = "kim18",
    effect: Annotated[list[str] | None, typer.Option(help="Effect to hide, NAME=SIZE; repeatable.")] = None,
    seed: Annotated[int, typer.Option(help="Of coefficients, mount and noise.")] = 4,
    look: Annotated[float, typer.Option(min=10.0, help="Length of test between looks at the data (s).")] = 180.0,
) -> None:
    """Tell one adaptive test in full: each choice with its reason, how sigmas and errors fell."""
    from sdimu_calibration.core.adaptive import Menu
    from sdimu_calibration.storage.files.config import load_imu, load_model, load_site
    from sdimu_calibration.storage.files.goal_file import load_goals
    from sdimu_calibration.storage.files.table_file import load_rate_table
    from sdimu_sim.core.scenario import imu_truth
    from sdimu_sim.own_effects import simulated_effects
    from sdimu_study.adaptive import scenario_of
    from sdimu_study.adaptive_picture import write_picture
    from sdimu_study.adaptive_test import adaptive_test
    from sdimu_study.worlds import in_the_mean

    console, told, limits = plain(), list[str](), load_goals(goals)

    def tell(text: str) -> None:
        told.append(text)
        console.print(text, soft_wrap=True, markup=False, highlight=False)

    scenario = scenario_of(load_imu("dtg"), load_site("daejeon"), seed, simulated_effects(effect or ()))
    sensor, table, model = imu_truth(scenario), load_rate_table("ideal"), load_model("baseline")
    done = adaptive_test(scenario, sensor, table, model, limits, Menu(), look, tell)
    tell(f"{done.plan.duration_s / 60.0:5.1f} min  the test ends: {done.end.reason}")
    tell(done.last.found.sentence)
    true = in_the_mean(sensor, done.last.found.fit.test.recording, seed)
    write_picture(out / "adaptive-run.png", done, limits, true)
    (out / "choices.txt").write_text("\n".join(told) + "\n", encoding="utf-8")
    console.print(f"results in {out}", soft_wrap=True)


@app.command()
def mount(
    out: Annotated[Path, typer.Option(help="Folder of mount.json and mount.html.")] = Path("out/study-mount"),
    seeds: Annotated[int, typer.Option(min=1, help="IMUs a mount; seeds 1 to this.")] = 10,
    largest: Annotated[int, typer.Option(min=0, max=45, help="Largest mount (deg), in steps of one.")] = 5,
    plan: Annotated[str, typer.Option(help="Test plan: name in config/plan or path.")] = "kim18",
    imu: Specification = "dtg",
    model: Wanted = "baseline",
    site: Place = "daejeon",
) -> None:
    """Draw error against mount misalignment for the filter and the classical calibration."""
    from sdimu_calibration.cli.progress import bar
    from sdimu_calibration.core.effects.imu_model import build
    from sdimu_calibration.storage.files.config import load_imu, load_model, load_plan, load_site
    from sdimu_calibration.storage.files.json_file import write_json
    from sdimu_sim.core.scenario import Scenario
    from sdimu_study.mount import mount_study, tables, write_page

    console = plain()
    wanted, specification = load_model(model), load_imu(imu)
    scenario = Scenario(load_plan(plan), specification, load_site(site))
    with bar(console) as progress:
        mounts = [float(m) for m in range(largest + 1)]
        content = mount_study(scenario, wanted, mounts, range(1, seeds + 1), progress)
    units = {e.name: e.parameters[0].display_unit for e in build(wanted.effects, specification).effects}
    write_json(out / "mount.json", content)
    write_page(out / "mount.html", content, units)
    for estimator, one in tables(content, units).items():
        console.print(one.terminal(estimator))
    console.print(f"results in {out}", soft_wrap=True)


@app.command()
def faults(
    out: Annotated[Path, typer.Option(help="Folder of faults.json and faults.md.")] = Path("out/study-faults"),
    seeds: Annotated[int, typer.Option(min=1, help="Tests a fault and size; seeds 1 to this.")] = 3,
    only: Annotated[list[str] | None, typer.Option(help="Kind of fault; repeatable. All by default.")] = None,
    plan: Annotated[str, typer.Option(help="Test plan, done in a hurry: name or path.")] = "kim18_signed",
    imu: Specification = "dtg",
    model: Wanted = "baseline",
    site: Place = "daejeon",
) -> None:
    """Spoil tests with every kind of fault at five sizes: none may end silently wrong. Exit status 1 if one does."""
    from sdimu_calibration.cli.progress import bar
    from sdimu_calibration.core.recording import DataError
    from sdimu_calibration.storage.files.config import load_imu, load_model, load_plan, load_site
    from sdimu_calibration.storage.files.json_file import write_json
    from sdimu_sim.core.scenario import Scenario
    from sdimu_study.fault_kinds import FAULTS
    from sdimu_study.faults import TRACEBACK, WRONG, content, fault_study, hurried, page, table, totals
    from sdimu_study.study import Table

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
    lines = [(name, *cells) for name, _, cells in table(outcomes)]
    console.print(Table(("fault", "1", "2", "3", "4", "5"), lines).terminal())
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
    seed: Seed = 50_001,
    draws: Annotated[int, typer.Option(min=0, help="Tests of each file and plan whose estimator is noted.")] = 50,
    imu: Imus = None,
    workers: Workers = 2,
) -> None:
    """Diagnose clean tests and tests with one hidden effect of every IMU file."""
    from sdimu_study.grades import CLEAN, HIDDEN, STUDY, choices, page

    names, kinds = imu_files(imu), (CLEAN, HIDDEN)
    cases = {(name, kind): (name, kind) for name in names for kind in kinds}
    results = conduct(STUDY, cases, range(seed, seed + runs), out, workers)
    chosen = {name: choices(name, seed, draws) for name in names}
    rows = {kind: {name: results[name, kind] for name in names} for kind in kinds} | {"choices": chosen}
    leave(out / "grades", rows, page(results, chosen, seed))


@app.command()
def reliability(
    out: Annotated[Path, typer.Option(help="Folder of runs, reliability.json, .md and .svg.")] = Path(
        "out/study-reliability"
    ),
    runs: Annotated[int, typer.Option("-n", min=1, help="Tests of each IMU file and kind of worlds.")] = 10,
    seed: Seed = 81_001,
    imu: Imus = None,
    kind: Annotated[
        list[str] | None, typer.Option(help="clean, noise, one, many, mixed, believed; repeatable. All by default.")
    ] = None,
    workers: Workers = 2,
) -> None:
    """Hold the probabilities of diagnoses against the truth, and draw them."""
    from sdimu_study.reliability import KINDS, STUDY, ReliabilityCase, kinds_of, page, picture

    check_kinds(kind, KINDS)
    cases = {
        (name, one): ReliabilityCase(name, one) for name in imu_files(imu) for one in kinds_of(name, kind or KINDS)
    }
    results = conduct(STUDY, cases, range(seed, seed + runs), out, workers)
    (out / "reliability.svg").write_text(picture(results), encoding="utf-8")
    leave(out / "reliability", results, page(results, seed))


@app.command()
def clean(
    out: Annotated[Path, typer.Option(help="Folder of runs, clean.json, clean.md.")] = Path("out/study-clean"),
    runs: Annotated[int, typer.Option("-n", min=1, help="Tests of each IMU file and plan.")] = 17,
    seed: Seed = 55_001,
    imu: Imus = None,
    workers: Workers = 2,
) -> None:
    """Diagnose tests with nothing hidden in them: every IMU file on plans from six positions to random attitudes."""
    from sdimu_study.clean import STUDY, page, plans_of

    cases = {(name, plan): (name, plan) for name in imu_files(imu) for plan in plans_of(name)}
    results = conduct(STUDY, cases, range(seed, seed + runs), out, workers)
    leave(out / "clean", results, page(results, seed))


@app.command()
def disturbed(
    out: Annotated[Path, typer.Option(help="Folder of runs and disturbed.json.")] = Path("out/study-disturbed"),
    runs: Annotated[int, typer.Option("-n", min=1, help="Tests of each disturbance.")] = 10,
    seed: Seed = 113_001,
    workers: Workers = 2,
) -> None:
    """Diagnose tests on benches that are not ideal: site told wrong, table that vibrates, stamps that jitter."""
    from sdimu_study.disturbed import CASES, STUDY

    conduct_as_table(STUDY, CASES, range(seed, seed + runs), out, workers)


@app.command()
def flicker(
    out: Annotated[Path, typer.Option(help="Folder of runs and flicker.json.")] = Path("out/study-flicker"),
    runs: Annotated[int, typer.Option("-n", min=1, help="Tests of each IMU file, size, plan and rate.")] = 40,
    seed: Seed = 153_001,
    workers: Workers = 2,
) -> None:
    """Calibrate MEMS in one and three times the flicker of their data sheets: do the sigmas hold."""
    from sdimu_study.flicker import CASES, STUDY

    conduct_as_table(STUDY, CASES, range(seed, seed + runs), out, workers)


@app.command()
def way(
    out: Annotated[Path, typer.Option(help="Folder of runs and way.json.")] = Path("out/study-way"),
    runs: Annotated[int, typer.Option("-n", min=1, help="Tests of each IMU file and noise.")] = 20,
    seed: Seed = 92_001,
    imu: Annotated[list[str] | None, typer.Option(help="IMU file; repeatable. All on a table by default.")] = None,
    noise: Annotated[list[str] | None, typer.Option(help="white, flicker; repeatable. Both by default.")] = None,
    workers: Workers = 2,
) -> None:
    """Feed tests to the filter on the way: do its sigmas hold after some stops."""
    from sdimu_study.way import NOISES, STUDY
    from sdimu_study.worlds import HANDHELD

    check_kinds(noise, NOISES)
    names = imu_files(imu, without=HANDHELD)
    cases = {(name, one): (name, one) for name in names for one in noise or NOISES}
    conduct_as_table(STUDY, cases, range(seed, seed + runs), out, workers)


@app.command()
def noise(
    out: Annotated[Path, typer.Option(help="Folder of runs, noise.json, noise.md.")] = Path("out/study-noise"),
    runs: Annotated[int, typer.Option("-n", min=1, help="Tests of each IMU file and kind of noise.")] = 40,
    seed: Seed = 60_001,
    imu: Annotated[list[str] | None, typer.Option(help="IMU file; repeatable. All on a table by default.")] = None,
    kind: Annotated[list[str] | None, typer.Option(help="Kind of noise; repeatable. All by default.")] = None,
    sigmas: Annotated[
        float, typer.Option(min=0.0, help="Hide one effect of so many sigma, as the test sees it in the true noise.")
    ] = 0.0,
    workers: Workers = 2,
) -> None:
    """Diagnose tests in noise with a memory: are terms named with their size, do the sigmas hold."""
    from sdimu_sim.core.coloured import KINDS
    from sdimu_study.noise import STUDY, WHITE, NoiseCase, page
    from sdimu_study.worlds import HANDHELD

    known = (WHITE, *KINDS)
    check_kinds(kind, known)
    names = imu_files(imu, without=HANDHELD)
    cases = {(name, one): NoiseCase(name, one, sigmas) for name in names for one in kind or known}
    results = conduct(STUDY, cases, range(seed, seed + runs), out, workers)
    leave(out / "noise", results, page(results, seed))


@app.command()
def missing(
    out: Annotated[Path, typer.Option(help="Folder of runs, missing.json, missing.md.")] = Path("out/study-missing"),
    runs: Annotated[int, typer.Option("-n", min=1, help="Tests of each effect.")] = 10,
    seed: Seed = 65_001,
    imu: Annotated[str, typer.Option(help="IMU file of a rate table, in config/imu.")] = "dtg",
    effect: Annotated[list[str] | None, typer.Option(help="Effect; repeatable. All by default.")] = None,
    workers: Workers = 2,
) -> None:
    """Diagnose tests as if the catalogue lacked what is hidden in them: is that seen, do the sigmas hold."""
    from sdimu_study.missing import STUDY, families, page
    from sdimu_study.worlds import HANDHELD

    wanted = families(effect)
    (imu,) = imu_files([imu], without=HANDHELD)
    results = conduct(STUDY, {(name,): (imu, name) for name in wanted}, range(seed, seed + runs), out, workers)
    leave(out / "missing", results, page(imu, results, seed))


@app.command()
def many(
    out: Annotated[Path, typer.Option(help="Folder of runs and many.json.")] = Path("out/study-many"),
    runs: Annotated[int, typer.Option("-n", min=1, help="Tests of each IMU file.")] = 50,
    seed: Seed = 67_001,
    imu: Annotated[
        list[str] | None, typer.Option(help="IMU file of a rate table; repeatable. dtg, rlg_navigation by default.")
    ] = None,
    workers: Workers = 2,
) -> None:
    """Diagnose tests with five to twelve effects of 3 to 50 sigma at once."""
    from sdimu_study.many import STUDY
    from sdimu_study.worlds import HANDHELD

    names = imu_files(imu or ["dtg", "rlg_navigation"], without=HANDHELD)
    results = conduct(STUDY, {(name,): (name,) for name in names}, range(seed, seed + runs), out, workers)
    leave(out / "many", results, STUDY.table(results))


@app.command()
def sets(
    out: Annotated[Path, typer.Option(help="Folder of runs and sets.json.")] = Path("out/study-sets"),
    runs: Annotated[int, typer.Option("-n", min=1, help="Sets of each kind.")] = 20,
    seed: Seed = 71_001,
    kind: Annotated[list[str] | None, typer.Option(help="Kind of set, such as weak or soaks; repeatable. All.")] = None,
    imu: Imu = "dtg",
    workers: Workers = 2,
) -> None:
    """Fit and diagnose sets of recordings of one unit; soaks: every coefficient a polynomial of the temperature."""
    from sdimu_study.sets import KINDS, STUDY
    from sdimu_study.soaks import SOAK_KINDS, tables
    from sdimu_study.soaks import STUDY as SOAKS
    from sdimu_study.worlds import HANDHELD

    check_kinds(kind, (*KINDS, *SOAK_KINDS))
    (imu,) = imu_files([imu], without=HANDHELD)
    results: dict[Key, list[Row]] = {}
    for name in kind or (*KINDS, *SOAK_KINDS):
        study = SOAKS if name in SOAK_KINDS else STUDY
        results |= conduct(study, {(name,): (name, imu)}, range(seed, seed + runs), out, workers)
    plain_sets = {key: rows for key, rows in results.items() if key[0] in KINDS}
    soaks = [one for (name,), rows in results.items() if name in SOAK_KINDS for one in tables(name, rows)]
    leave(out / "sets", results, *([STUDY.table(plain_sets)] if plain_sets else []), *soaks)


@app.command()
def hand(
    out: Annotated[Path, typer.Option(help="Folder of runs and hand.json.")] = Path("out/study-hand"),
    runs: Annotated[int, typer.Option("-n", min=1, help="Clean runs, and as many with a hidden effect.")] = 100,
    seed: Seed = 69_001,
    workers: Workers = 2,
) -> None:
    """Diagnose runs by hand of any grade and rate, with bias instability and rests that somebody nudges."""
    from sdimu_study.hand import CLEAN, HIDDEN, STUDY, refused, table

    cases = {(kind,): (kind,) for kind in (CLEAN, HIDDEN)}
    results = conduct(STUDY, cases, range(seed, seed + runs), out, workers)
    leave(out / "hand", results, table(results))
    why = refused(results)
    plain().print(f"refused: {len(why)}", *sorted(set(why))[:5], sep="\n", markup=False)


@app.command()
def static(
    out: Annotated[Path, typer.Option(help="Folder of runs and static.json.")] = Path("out/study-static"),
    runs: Annotated[int, typer.Option("-n", min=1, help="Units of each IMU file and kind of set.")] = 20,
    seed: Seed = 95_001,
    kind: Annotated[list[str] | None, typer.Option(help="cube, 'up and down'; repeatable. All by default.")] = None,
    imu: Imus = None,
    workers: Workers = 2,
) -> None:
    """Calibrate and diagnose static recordings as one set: rests of a cube, up and down, noise with a memory."""
    from sdimu_study.static import CASES, KINDS, STUDY

    check_kinds(kind, KINDS)
    wanted = imu_files(imu)
    cases = {key: case for key, case in CASES.items() if key[0] in (kind or KINDS) and key[1] in wanted}
    conduct_as_table(STUDY, cases, range(seed, seed + runs), out, workers)


@app.command()
def trembling(
    out: Annotated[Path, typer.Option(help="Folder of runs and trembling.json.")] = Path("out/study-trembling"),
    runs: Annotated[int, typer.Option("-n", min=1, help="Runs of each IMU file.")] = 50,
    seed: Seed = 93_001,
    workers: Workers = 2,
) -> None:
    """Calibrate runs by hand of which up to half of the rests tremble, and with the rests known beside it."""
    from sdimu_study.trembling import CASES, STUDY

    conduct_as_table(STUDY, CASES, range(seed, seed + runs), out, workers)


@app.command()
def parts(
    out: Annotated[Path, typer.Option(help="Folder of runs and parts.json.")] = Path("out/study-parts"),
    runs: Annotated[int, typer.Option("-n", min=1, help="Runs of each IMU file.")] = 60,
    seed: Seed = 94_001,
    workers: Workers = 2,
) -> None:
    """Calibrate runs by hand cut in parts of few rests as sets: in one scatter, and each part in its own."""
    from sdimu_study.parts import CASES, STUDY

    conduct_as_table(STUDY, CASES, range(seed, seed + runs), out, workers)
