"""The verb `sdimu bench`: how fast the core, the reader and the whole way from a bag to result and diagnosis are."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated, Any

import typer

from sdimu_calibration.cli.console import plain


def bench(
    plan: Annotated[str, typer.Option(help="Test plan: name in config/plan or path.")] = "kim18",
    rate: Annotated[float, typer.Option(help="Sample rate of the IMU (Hz), 10 to 1000.")] = 100.0,
    repeats: Annotated[int, typer.Option(min=1, help="Each time is the best of so many.")] = 3,
) -> None:
    """Time the parts of a calibration on a simulated test, after a first run that compiles."""
    from rich.box import SIMPLE_HEAD
    from rich.table import Table

    with TemporaryDirectory() as folder:
        lines = [
            (what, f"{wall:.3f} s", f"{cpu:.3f} s", f"{count / wall:,.{0 if count > wall * 100 else 2}f} {noun}/s")
            for what, wall, cpu, count, noun in measure(plan, rate, repeats, Path(folder))
        ]
    table = Table(pad_edge=False, box=SIMPLE_HEAD)
    for place, column in enumerate(("what", "wall", "processor", "rate")):
        # A narrow terminal may wrap lines; it must not cut digits.
        width = max(len(line[place]) for line in lines)
        table.add_column(column, justify="left" if column == "what" else "right", min_width=width)
    for line in lines:
        table.add_row(*line)
    plain().print(table, soft_wrap=True)


def measure(plan: str, rate: float, repeats: int, folder: Path) -> list[tuple[str, float, float, int, str]]:
    """Time the parts.

    Parameters
    ----------
    plan : str
        Name or path.
    rate : float
        Hz.
    repeats : int
    folder : Path
        For the bag.

    Returns
    -------
    list of (str, float, float, int, str)
        What, wall and processor time (s; the smallest of `repeats`), how many of what it worked on.
    """
    from rate_table_sim.table_file import load_table
    from sdimu_calibration.api import functions as api
    from sdimu_calibration.api.diagnosis import FitDiagnosis
    from sdimu_calibration.core.alignment.prepared import first_attitude, reduce, set_up
    from sdimu_calibration.core.estimation.outcome import calibrate
    from sdimu_calibration.core.filter.passes import one_pass
    from sdimu_calibration.storage.bags.bag_reader import read_recording
    from sdimu_calibration.storage.files.config import load_imu, load_model, load_plan, load_site
    from sdimu_calibration.storage.files.diagnosis_file import write_diagnosis
    from sdimu_calibration.storage.files.result_file import write_result
    from sdimu_sim.bag_file import write_test
    from sdimu_sim.core.scenario import Scenario, simulate_test
    from sdimu_study.monte_carlo import STUDY, Campaign

    imu, model, site = load_imu("dtg"), load_model("baseline"), load_site("daejeon")
    scenario = Scenario(plan=load_plan(plan), imu=imu, site=site, table=load_table("ideal"), rate_hz=rate)
    bag = folder / "bag"
    write_test(bag, scenario, simulate_test(scenario))
    recording = read_recording(bag)
    setup = set_up(site, imu, model)
    prepared = reduce(recording, setup)
    start = first_attitude(prepared.epochs, prepared.phases, setup)
    found = calibrate(recording, site, imu, model)
    n = len(recording.t)

    def one() -> None:
        one_pass(prepared, setup, start, start.C_nb, found.values)

    def whole() -> None:
        write_result(folder / "result.json", calibrate(read_recording(bag), site, imu, model))

    def diagnosed() -> FitDiagnosis:
        return api.diagnose(api.calibrate(api.open(bag)))

    def diagnosis_alone() -> None:
        write_diagnosis(folder / "diagnosis.json", diagnosed().summary)

    parts: list[tuple[str, Callable[[], Any], int, str]] = [
        ("reduce samples to cycles and epochs", lambda: reduce(recording, setup), n, "samples"),
        ("one pass: motion, navigation, filter", one, n, "samples"),
        ("calibrate with held-out stops", lambda: calibrate(recording, site, imu, model), n, "samples"),
        ("read the bag", lambda: read_recording(bag), n, "samples"),
        ("bag to result.json", whole, n, "samples"),
        ("bag to diagnosis.json", diagnosis_alone, n, "samples"),
        ("the same with result.json and report.html", lambda: diagnosed().save(folder), n, "samples"),
        ("one Monte-Carlo run", lambda: STUDY.of(Campaign(scenario, model))(1), 1, "runs"),
    ]
    return [(what, *_best(work, repeats), count, noun) for what, work, count, noun in parts]


def _best(work: Callable[[], Any], repeats: int) -> tuple[float, float]:
    """Smallest wall and processor time (s): whatever disturbs only adds."""
    import time

    work()  # compiles, fills caches
    walls, cpus = [], []
    for _ in range(max(repeats, 1)):
        wall, cpu = time.perf_counter(), time.process_time()
        work()
        walls.append(time.perf_counter() - wall)
        cpus.append(time.process_time() - cpu)
    return min(walls), min(cpus)
