"""`sdimu plan`: a shorter or more telling plan, or the turn that tells effects apart."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from sdimu_calibration.cli.console import plain

if TYPE_CHECKING:
    from rich.table import Table

    from sdimu_calibration.core.plan import Plan
    from sdimu_calibration.core.plan_search import Bounds, Found

_LIMIT = "Largest sigma allowed, EFFECT='0.005 deg/h'; may be repeated. By default what --plan reaches, times --slack."


def plan(
    plan: Annotated[str, typer.Option(help="Plan to begin with: name in config/plan or path.")] = "kim18",
    imu: Annotated[str, typer.Option(help="Specification of the IMU: name in config/imu or path.")] = "dtg",
    site: Annotated[str, typer.Option(help="Where the test will be: name in config/site or path.")] = "daejeon",
    model: Annotated[str, typer.Option(help="Model to estimate: name in config/model or path.")] = "baseline",
    add: Annotated[
        list[str] | None, typer.Option(metavar="EFFECT", help="Effect that the plan should also show; may be repeated.")
    ] = None,
    minutes: Annotated[
        float | None, typer.Option(min=1.0, help="Time available: the best sigmas in it. Without: the shortest plan.")
    ] = None,
    limit: Annotated[list[str] | None, typer.Option(metavar="EFFECT=SIGMA", help=_LIMIT)] = None,
    slack: Annotated[float, typer.Option(min=0.01, help="Factor on the sigmas of --plan that are the limits.")] = 1.2,
    rates: Annotated[str, typer.Option(help="Mean rates the table can do (deg/s).")] = "2,10",
    acceleration: Annotated[float, typer.Option(help="Acceleration the table can do (deg/s^2).")] = 20.0,
    dwells: Annotated[str, typer.Option(help="Lengths of stops to choose from (s).")] = "20,40,60,80,100,130",
    tries: Annotated[int, typer.Option(min=1, help="Most plans to evaluate.")] = 150,
    tell: Annotated[
        list[str] | None,
        typer.Option(metavar="COEFFICIENT", help="Rank extra turns that tell these apart, and search no plan."),
    ] = None,
    out: Annotated[Path, typer.Option(help="Plan file to write.")] = Path("out/plan/found.yaml"),
) -> None:
    """Search for a plan with the bound of the data; leaves a plan file for --plan."""
    from sdimu_calibration.cli.progress import bar
    from sdimu_calibration.core.plan_search import Goal, Question, next_turn, search
    from sdimu_calibration.core.plan_search.bound import bounds
    from sdimu_calibration.core.plan_search.moves import Abilities
    from sdimu_calibration.storage.config import load_imu, load_plan, load_site
    from sdimu_calibration.storage.model_choice import named_model
    from sdimu_calibration.storage.plan_file import write_plan

    console = plain()
    start = load_plan(plan)
    asked = Question(load_site(site), load_imu(imu), named_model(model, add or []))
    speeds = tuple(math.radians(v) for v in _numbers("--rates", rates))
    if tell:
        with bar(console) as progress:
            ranked = next_turn(start, asked, tell, rates_rad_s=speeds, progress=progress)
        for one in ranked[:5]:
            console.print(one.text, soft_wrap=True, highlight=False)
        return
    able = Abilities(speeds, math.radians(acceleration), tuple(_numbers("--dwells", dwells)))
    with bar(console) as progress:
        before = bounds(start, asked)
        limits = {e: slack * sigma for e, sigma in before.largest().items()} | _limits(limit or [])
        found = search(start, asked, able, Goal(limits, minutes), tries, progress)
    title = f"sigma, the largest of the axes: {start.name} and {out.stem}"
    console.print(_table(title, start, before, found, limits))
    if found.plan is start:
        console.print(f"nothing better than {start.name} among {found.tried} plans; no file written", soft_wrap=True)
        return
    about = f"Found by sdimu plan from {start.name} among {found.tried} plans: {found.minutes:.1f} min."
    write_plan(out, found.plan, [about, f"IMU {imu}, site {site}, worst sigma {found.worst:.3f} of its limit."])
    console.print(
        f"{start.name} {start.duration_s / 60.0:.1f} min; found {found.minutes:.1f} min, worst sigma "
        f"{found.worst:.2f} of its limit, {found.tried} plans tried; use: --plan {out}",
        soft_wrap=True, highlight=False,
    )  # fmt: skip


def _table(title: str, start: Plan, before: Bounds, found: Found, limits: Mapping[str, float]) -> Table:
    from rich.table import Table

    from sdimu_calibration.core.units import from_si

    made = Table("effect", start.name, "found", "limit", "unit", title=title, pad_edge=False)
    units = dict(zip(before.effect, before.units, strict=True))
    old, new = before.largest(), found.bounds.largest()
    for column in made.columns[1:4]:
        column.justify = "right"
    for effect, limit in limits.items():
        cells = (f"{from_si(v, units[effect]):.3g}" for v in (old[effect], new[effect], limit))
        made.add_row(effect, *cells, units[effect])
    made.add_row("minutes", f"{start.duration_s / 60.0:.1f}", f"{found.minutes:.1f}", "", "min")
    return made


def _limits(texts: Sequence[str]) -> dict[str, float]:
    """Read ``EFFECT=SIGMA`` into SI."""
    from sdimu_calibration.core.effects import selection
    from sdimu_calibration.core.recording import DataError
    from sdimu_calibration.core.units import parse_quantity

    out = {}
    for text in texts:
        name, equals, value = text.partition("=")
        if not equals:
            raise DataError(f"--limit '{text}': expected EFFECT=SIGMA such as gyro_bias='0.005 deg/h'")
        effect = selection.resolve(name.strip())
        out[effect.family or effect.name] = parse_quantity(value, effect.parameters[0].display_unit)
        if not out[effect.family or effect.name] > 0.0:
            raise DataError(f"--limit '{text}': expected more than zero")
    return out


def _numbers(option: str, text: str) -> list[float]:
    """Read numbers with commas between them, all above zero."""
    from sdimu_calibration.core.recording import DataError

    try:
        values = [float(part) for part in text.split(",")]
    except ValueError:
        values = []
    if not values or not all(math.isfinite(v) and v > 0.0 for v in values):
        raise DataError(f"{option} '{text}': expected numbers above zero, such as '2,10'")
    return values
