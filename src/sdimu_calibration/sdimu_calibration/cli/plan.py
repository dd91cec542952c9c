"""`sdimu plan`: a shorter or more telling plan, or the turn that tells effects apart."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from sdimu_calibration.cli.console import answer, command, plain, say
from sdimu_calibration.cli.option_groups import with_options
from sdimu_calibration.cli.options import JsonOption, ModelOption
from sdimu_calibration.cli.progress import bar
from sdimu_calibration.cli.wide_table import print_table
from sdimu_calibration.core.data_error import DataError
from sdimu_calibration.core.effect_key import read_quantity
from sdimu_calibration.core.plain_text import three
from sdimu_calibration.core.units import from_si
from sdimu_calibration.shell_words import joined

if TYPE_CHECKING:
    from rich.console import Console

    from sdimu_calibration.core.evidence.known import Standing
    from sdimu_calibration.core.plan import Plan
    from sdimu_calibration.core.plan_search import Bounds, Found, NextTurn, Question
    from sdimu_calibration.core.plan_search.moves import Abilities

_MOST_RATE, _MOST_ACCELERATION, _MOST_DWELL = 1e4, 1e6, 1e6
"""Fastest turn (deg/s), acceleration (deg/s^2) and longest stop (s) of a plan's file."""

_ROUNDING_MIN = 1e-6
"""Tolerance (min) of the time available: rounding of a sum."""


@dataclass(frozen=True)
class Planned:
    """What a plan is for."""

    plan: Annotated[str, typer.Option(help="Plan to begin with: name in config/plan or path.")] = "kim18"
    imu: Annotated[
        str | None, typer.Option(help="Specification of the IMU: name in config/imu or path; that of --after, or dtg.")
    ] = None
    site: Annotated[
        str | None, typer.Option(help="Where the test will be: name in config/site or path; of --after, or daejeon.")
    ] = None
    model: ModelOption = "baseline"
    add: Annotated[
        list[str] | None, typer.Option(metavar="EFFECT", help="Effect that the plan should also show; may be repeated.")
    ] = None


@dataclass(frozen=True)
class Allowed:
    """What a plan may take, and what the table can do."""

    minutes: Annotated[
        float | None, typer.Option(min=1.0, help="Time available: the best sigmas in it. Without: the shortest plan.")
    ] = None
    limit: Annotated[
        list[str] | None,
        typer.Option(
            metavar="EFFECT=SIGMA",
            help="Largest sigma allowed, EFFECT='0.005 deg/h'; may be repeated. By default what --plan reaches, times "
            "--slack.",
        ),
    ] = None
    slack: Annotated[float, typer.Option(min=0.01, help="Factor on the sigmas of --plan that are the limits.")] = 1.2
    rates: Annotated[str, typer.Option(help="Mean rates the table can do (deg/s).")] = "2,10"
    acceleration: Annotated[float, typer.Option(help="Acceleration the table can do (deg/s^2).")] = 20.0
    dwells: Annotated[str, typer.Option(help="Lengths of stops to choose from (s).")] = "20,40,60,80,100,130"
    tries: Annotated[int, typer.Option(min=1, help="Most plans to evaluate.")] = 150

    @property
    def acceleration_rad_s2(self) -> float:
        """Acceleration in SI."""
        if not 0.0 < self.acceleration <= _MOST_ACCELERATION:
            raise DataError(f"--acceleration {self.acceleration:g}: expected above 0 to {_MOST_ACCELERATION:g} deg/s^2")
        return math.radians(self.acceleration)

    @property
    def rates_rad_s(self) -> tuple[float, ...]:
        """Mean rates in SI."""
        return tuple(math.radians(v) for v in _numbers("--rates", self.rates, _MOST_RATE))

    @property
    def abilities(self) -> Abilities:
        """Of the table, in SI."""
        from sdimu_calibration.core.plan_search.moves import Abilities

        rates, dwells = self.rates_rad_s, tuple(_numbers("--dwells", self.dwells, _MOST_DWELL))
        return Abilities(rates, self.acceleration_rad_s2, dwells)

    def check_turns(self, start: Plan) -> None:
        """Raise DataError where the acceleration allows no turn of a plan, at the slowest of the rates either."""
        slowest = min(self.rates_rad_s)
        # A turn that speeds up over its first half and slows down over the other needs the least.
        least = min((4.0 * slowest**2 / abs(turn.angle_rad) for turn in start.turns), default=0.0)
        if least > self.acceleration_rad_s2:
            raise DataError(
                f"--acceleration {self.acceleration:g}: too low for every turn of {start.name}: at a mean of "
                f"{math.degrees(slowest):g} deg/s (--rates) they need {math.degrees(least):.2g} deg/s^2 and more; "
                "state what the table can do, or slower --rates"
            )


@dataclass(frozen=True)
class PlanRequest:
    """What is asked beside the shortest plan, and where the answer goes."""

    tell: Annotated[
        list[str] | None,
        typer.Option(metavar="COEFFICIENT", help="Rank extra turns that tell these apart, and search no plan."),
    ] = None
    after: Annotated[
        list[Path] | None,
        typer.Option(
            metavar="BAG or FOLDER",
            help="What is known already: recordings of the unit, or results of calibrate or "
            "diagnose. Searches the plan that tells most beyond it in --minutes (those of --plan).",
        ),
    ] = None
    backwards: Annotated[
        bool, typer.Option("--backwards", help="Write --plan in the opposite order, and search no plan.")
    ] = False
    out: Annotated[Path, typer.Option(help="Plan file to write.")] = Path("out/plan/found.yaml")
    replace: Annotated[bool, typer.Option("--replace", help="Replace a plan file that is already there.")] = False
    as_json: JsonOption = False


@with_options
def plan(
    more: Annotated[
        list[Path] | None, typer.Argument(metavar="[BAG...]", help="More recordings behind --after.")
    ] = None,
    *,
    planned: Planned,
    allowed: Allowed,
    request: PlanRequest,
) -> None:
    """Search for a plan with the bound of the data; leaves a plan file for --plan."""
    from sdimu_calibration.core.plan_search import Question
    from sdimu_calibration.storage.bags.file_room import check_file_room
    from sdimu_calibration.storage.files.config import load_imu, load_plan, load_site
    from sdimu_calibration.storage.files.model_choice import named_model

    console = plain(stderr=request.as_json)
    start = load_plan(planned.plan)
    paths = [*(request.after or []), *(more or [])]
    if not request.tell:
        sources = _sources(planned, paths)
        check_file_room(request.out, "--out", kind="sdimu-plan", replace=request.replace, sources=sources)
    if request.backwards:
        _write_backwards(console, start, request.out)
        answer({"plan": str(request.out), "minutes": start.duration_s / 60.0}, request.as_json)
        return
    if more and not request.after:
        raise typer.BadParameter("recordings stand behind --after", param_hint="BAG")
    before = standing_of(console, paths, planned) if request.after else None
    imu = planned.imu or (before and before.imu) or "dtg"
    site = planned.site or (before and before.site) or "daejeon"
    wanted = named_model(planned.model, [*(before.added if before else ()), *(planned.add or [])])
    question = Question(load_site(site), load_imu(imu), wanted, before.known if before else None)
    asked = _Begun(start, question, before, imu, site)
    if request.tell:
        _tell(console, asked, request.tell, allowed, request.as_json)
    else:
        _search(console, asked, allowed, request)


def _sources(planned: Planned, after: Sequence[Path]) -> list[Path]:
    """List what is read: files of the configuration, recordings, and results in their folders."""
    from sdimu_calibration.storage.files.config import find_config
    from sdimu_calibration.storage.files.effect_file import effect_files
    from sdimu_calibration.storage.recording_set import is_bag

    stated = {"plan": planned.plan, "imu": planned.imu, "site": planned.site, "model": planned.model}
    files = [find_config(kind, name) for kind, name in stated.items() if name is not None]
    known = [file for path in after for file in ([path] if is_bag(path) else [path, *path.glob("*.json")])]
    return files + effect_files(planned.add or []) + [path for path in known if is_bag(path) or path.is_file()]


@dataclass(frozen=True)
class _Begun:
    """What a search begins with: a plan, the question, what is known, and the names of IMU and site."""

    start: Plan
    question: Question
    before: Standing | None
    imu: str
    site: str


def _tell(console: Console, asked: _Begun, coefficients: Sequence[str], allowed: Allowed, as_json: bool) -> None:
    """Rank extra turns that tell coefficients apart."""
    from sdimu_calibration.core.plan_search import next_turn, untold

    # The next recording is one of its own: the shortest that tells these apart.
    onto = replace(asked.start, dwell_s=asked.start.dwell_s[:1], turns=()) if asked.before else asked.start
    speeds = allowed.rates_rad_s
    with bar(console) as progress:
        ranked = next_turn(onto, asked.question, coefficients, rates_rad_s=speeds, progress=progress)
    none = untold(ranked, coefficients)
    where = "Turns of the next recording" if asked.before else f"Turns after those of {asked.start.name}"
    heading = f"{where} that tell {' from '.join(coefficients)}, the most a minute first:"
    for text in [none] if none else [heading, *(one.text for one in ranked[:5])]:
        say(console, text)
    answer(_ranking(asked.start, coefficients, ranked) | ({"none": none} if none else {}), as_json)


def _search(console: Console, asked: _Begun, allowed: Allowed, request: PlanRequest) -> None:
    """Search a plan, show what it brings and write it where it is better."""
    from sdimu_calibration.core.plan_search import Goal, search
    from sdimu_calibration.core.plan_search.bound import already, bounds
    from sdimu_calibration.storage.files.plan_file import write_plan

    start, before, out = asked.start, asked.before, request.out
    able, minutes = allowed.abilities, allowed.minutes
    allowed.check_turns(start)
    with bar(console) as progress:
        first = bounds(start, asked.question)
        usual = {} if before else {e: allowed.slack * sigma for e, sigma in first.largest().items()}
        limits = usual | _limits(allowed.limit or [])
        if not limits and minutes is None:
            minutes = start.duration_s / 60.0
        found = search(start, asked.question, able, Goal(limits, minutes), allowed.tries, progress)
    known = already(asked.question) if before else None
    if not found.plan.turns:
        say(
            console,
            f"no plan with the attitudes of {start.name} that turns the IMU fits in --minutes {minutes:g}; no file "
            "written (more --minutes, shorter --dwells, faster --rates, or a --plan with fewer stops)",
        )
        answer(_content(start, known, first, found, limits, None), request.as_json)
        return
    reached = f"worst sigma {found.worst:.3f} of its limit" if limits else "tells most beyond what was known"
    if found.plan is not start:
        about = f"Found by sdimu plan from {start.name} among {found.tried} plans: {found.minutes:.1f} min."
        write_plan(out, found.plan, [about, f"IMU {asked.imu}, site {asked.site}, {reached}."])
    title = f"sigma, the largest of the axes: {start.name} and {out.stem}"
    print_table(console, *_table(start, known, first, found, limits), title)
    if before:
        tell_gain(console, start, found, before.open, (already(asked.question), first, found.bounds))
    too_long = minutes is not None and found.minutes > minutes + _ROUNDING_MIN
    if too_long:
        say(
            console,
            f"no plan with the attitudes of {start.name} fits in --minutes {minutes:g}: the shortest takes "
            f"{found.minutes:.1f} min (shorter --dwells, faster --rates, or a --plan with fewer stops)",
        )
    if found.plan is start:
        say(console, f"nothing better than {start.name} among {found.tried} plans; no file written")
        answer(_content(start, known, first, found, limits, None), request.as_json)
        return
    say(
        console,
        f"{start.name} {start.duration_s / 60.0:.1f} min; found {found.minutes:.1f} min, {reached}, {found.tried} "
        f"plans tried; in {out}. To look at it:",
    )
    command(console, joined(["sdimu", "predict", "--plan", str(out), "--imu", asked.imu, "--site", asked.site]))
    unseen = found.bounds.unseen
    if unseen:
        say(console, f"it leaves a coefficient or more of {', '.join(unseen)} at the prior (within 1 %)")
    answer(_content(start, known, first, found, limits, out), request.as_json)


def _write_backwards(console: Console, start: Plan, out: Path) -> None:
    """Write the plan whose recording tells what is of an attitude from what is of a time."""
    from sdimu_calibration.core.plan import backwards
    from sdimu_calibration.storage.files.plan_file import write_plan

    write_plan(out, backwards(start), [f"{start.name} in the opposite order, every turn in the other sense."])
    say(console, f"{start.name} backwards, {start.duration_s / 60.0:.1f} min; in {out}")


def _table(
    start: Plan, known: Bounds | None, first: Bounds, found: Found, limits: Mapping[str, float]
) -> tuple[list[str], list[list[str]]]:
    """Headings, and the largest sigma of each effect: what is known (where something is), with both plans, allowed."""
    columns = {"known": known, start.name: first, "found": found.bounds}
    shown = {name: b.largest() for name, b in columns.items() if b is not None}
    units = dict(zip(first.effect, first.units, strict=True))
    rows = []
    for effect in limits if known is None else shown["found"]:
        unit = units[effect]
        numbers = [sizes.get(effect) for sizes in shown.values()] + ([limits.get(effect)] if limits else [])
        rows.append([effect, *("" if v is None else three(from_si(v, unit)) for v in numbers), unit])
    lengths = {"known": "", start.name: f"{start.duration_s / 60.0:.1f}", "found": f"{found.minutes:.1f}"}
    rows.append(["minutes", *(lengths[name] for name in shown), *([""] if limits else []), "min"])
    return ["effect", *shown, *(["limit"] if limits else []), "unit"], rows


def _content(
    start: Plan, known: Bounds | None, first: Bounds, found: Found, limits: Mapping[str, float], out: Path | None
) -> dict[str, object]:
    """Give the plan that was found as plain data (SI); `file` is null where none is better."""
    sigma = {"before": first.largest(), "found": found.bounds.largest(), "limit": dict(limits)}
    return {
        "format": "sdimu-plan-search/1",
        "plan": start.name,
        "file": None if out is None else str(out),
        "minutes": {"before": start.duration_s / 60.0, "found": found.minutes},
        "worst": found.worst,
        "tried": found.tried,
        "sigma": sigma | ({"known": known.largest()} if known else {}),
    }


def _ranking(start: Plan, tell: Sequence[str], ranked: Sequence[NextTurn]) -> dict[str, object]:
    """Give the turns that tell coefficients apart as plain data, the most telling first."""
    turns = [asdict(one) | {"text": one.text} for one in ranked]
    return {"format": "sdimu-next-turn/1", "plan": start.name, "tell": list(tell), "turns": turns}


def _limits(texts: Sequence[str]) -> dict[str, float]:
    """Read ``EFFECT=SIGMA`` into SI."""
    from sdimu_calibration.core.effects import selection

    out = {}
    for text in texts:
        name, equals, value = text.partition("=")
        if not equals:
            raise DataError(f"--limit '{text}': expected EFFECT=SIGMA such as gyro_bias='0.005 deg/h'")
        effect = selection.resolve(name.strip())
        out[effect.family or effect.name] = read_quantity(f"--limit '{text}'", value, effect.parameters[0].display_unit)
        if not out[effect.family or effect.name] > 0.0:
            raise DataError(f"--limit '{text}': expected more than zero")
    return out


def _numbers(option: str, text: str, most: float) -> list[float]:
    """Read numbers with commas between them, all above zero and none above `most`."""
    try:
        values = [float(part) for part in text.split(",")]
    except ValueError:
        values = []
    if not values or not all(0.0 < v <= most for v in values):
        raise DataError(f"{option} '{text}': expected numbers above zero to {most:g}, such as '2,10'")
    return values


def standing_of(console: Console, paths: Sequence[Path], asked: Planned) -> Standing:
    """Read what results know; recordings are diagnosed first, several as one set."""
    from sdimu_calibration.storage.files.standing_file import holds_standing, read_standing, standing_of_result

    results = [p for p in paths if holds_standing(p) or (p / "result.json").is_file() or p.name == "result.json"]
    if results and len(paths) > 1:
        raise DataError(
            f"--after {results[0]}: state one result alone, as two of them may count the same recording twice; to use "
            "several recordings, name their bags"
        )
    if results:
        return read_standing(results[0]) if holds_standing(results[0]) else standing_of_result(results[0], asked.imu)
    return _diagnosed(console, paths, asked)


def _diagnosed(console: Console, paths: Sequence[Path], asked: Planned) -> Standing:
    from sdimu_calibration.cli.options import FitRequest, StatedOpening
    from sdimu_calibration.cli.set_run import SetRequest, diagnosed_set
    from sdimu_calibration.core.diagnosis.diagnose import climb
    from sdimu_calibration.core.diagnosis.standing import standing
    from sdimu_calibration.core.diagnosis.summary import summarise
    from sdimu_calibration.core.estimation.solve import solve
    from sdimu_calibration.storage.files.config import load_imu
    from sdimu_calibration.storage.files.model_choice import named_model
    from sdimu_calibration.storage.opening import open_test

    if len(paths) > 1:
        request = SetRequest(paths, StatedOpening(asked.site, asked.imu), FitRequest(asked.model))
        found = diagnosed_set(console, request, ())
        say(console, f"{found.verdict}: {found.sentence}")
        return found.standing
    test = open_test(paths[0], asked.site, None if asked.imu is None else load_imu(asked.imu))
    with bar(console) as progress:
        one = summarise(climb(solve(test, named_model(asked.model, ()), progress=progress), progress=progress))
    say(console, f"{one.diagnosis.verdict}: {one.diagnosis.sentence}")
    return standing(one.diagnosis, one.found)


def tell_gain(
    console: Console, start: Plan, found: Found, classes: Sequence[Sequence[str]], sigmas: tuple[Bounds, Bounds, Bounds]
) -> None:
    """Say what the plan tells beyond what is known, beside the plan that the search began with.

    `classes`: what is open, by coefficients; `sigmas`: known, with the start, with the plan that was found.
    """
    from sdimu_calibration.core.effects.selection import resolve
    from sdimu_calibration.core.plan_search import gain
    from sdimu_calibration.core.plan_search.next_turn import apart, in_sigmas

    known, first, last = sigmas
    tells = [gain(known.covariance, b.covariance) for b in (first, last)]
    say(
        console,
        f"expected information beyond what is known: {tells[0]:.1f} nat by {start.name} in "
        f"{start.duration_s / 60.0:.1f} min, {tells[1]:.1f} nat by the plan found in {found.minutes:.1f} min "
        f"({found.tried} plans tried; nat: log of how the volume of the uncertainty shrinks)",
    )
    for labels in classes:
        names = [p.name for label in labels for p in resolve(label).parameters]
        sizes = in_sigmas(*(apart(b, names, None) for b in sigmas))
        say(
            console,
            f"{labels[0]} from {', '.join(labels[1:])}, each as large as its prior: apart by {sizes[0]} sigma now, "
            f"{sizes[1]} after {start.name}, {sizes[2]} after the plan found",
        )
