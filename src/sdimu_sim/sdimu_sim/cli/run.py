"""The verb `sdimu run`: a whole test as separate processes over DDS, watched to its end."""

from __future__ import annotations

import math
import sys
from contextlib import nullcontext
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from sdimu_calibration.cli.next_commands import (
    PLAN,
    PLAN_CHOSEN,
    PLAN_RUN,
    Asked,
    check_plan_room,
    print_advice,
    spelled,
)
from sdimu_calibration.cli.opened import NOT_TRUSTED, leave
from sdimu_calibration.cli.option_groups import with_options
from sdimu_calibration.cli.options import DomainOption, EachStopOption, Fitted, Place, outside_recordings
from sdimu_calibration.cli.serving import LivePage, PageOptions, ended
from sdimu_calibration.core.data_error import DataError
from sdimu_calibration.storage.files.whole_file import put_aside, same_file, written_together
from sdimu_sim.cli.options import SeedOption, World
from sdimu_sim.cli.usual_options import check_stated

if TYPE_CHECKING:
    from rich.console import Console

    from sdimu_calibration.cli.processes import Children, RunningTest
    from sdimu_calibration.core.diagnosis.summary import DiagnosisSummary
    from sdimu_calibration.core.results import Calibration
    from sdimu_calibration.report.live_page.record import LiveRecord
    from sdimu_calibration.report.live_seen import Outline

STALL_S = 180.0
START_NS = 1_700_000_000_000_000_000
"""Stamp of the begin of a simulated test (ns): the same in every run, so that runs of one seed are the same."""
DEFAULT_PLAN = "kim18"
DEFAULT_MODEL = "baseline"
TRUTH = "truth.yaml"


@dataclass(frozen=True)
class LiveTest:
    """What is run, and how it is followed."""

    plan: Annotated[
        str | None, typer.Option(help="Test plan: name in config/plan or path; kim18. Not with --adaptive.")
    ] = None
    imu: Annotated[str, typer.Option(help="IMU specification, from which the true errors are drawn.")] = "dtg"
    model: Annotated[str, typer.Option(help="Model to estimate.")] = DEFAULT_MODEL
    speed: Annotated[float, typer.Option(help="Times real time; 0 is as fast as nothing gets lost.")] = 0.0
    seed: SeedOption = 1
    diagnose: EachStopOption = True
    adaptive: Annotated[
        str | None, typer.Option(metavar="GOALS", help="Choose each turn by what is known; limits as in config/goal.")
    ] = None
    tell: Annotated[
        list[str] | None,
        typer.Option(metavar="COEFFICIENT", help="With --adaptive: tell the first of these from the others, too."),
    ] = None
    ask: Annotated[bool, typer.Option(help="With --adaptive: each turn waits for a yes on /adaptive/confirm.")] = False

    @property
    def followed(self) -> str:
        """The plan that the table begins with."""
        return self.plan or DEFAULT_PLAN

    @property
    def title(self) -> str:
        """What the test is called on its page."""
        return f"Simulated test: {self.course}, model {self.model}"

    @property
    def course(self) -> str:
        """What the table drives."""
        return f"adaptive to {self.adaptive}" if self.adaptive else f"plan {self.followed}"


@with_options
def run(
    test: LiveTest,
    world: World,
    page: PageOptions,
    domain: DomainOption = None,
    out: Annotated[
        Path, typer.Option(file_okay=False, callback=outside_recordings, help="Folder of the results.")
    ] = Path("out/run"),
    replace: Annotated[bool, typer.Option("--replace", help="Overwrite an earlier run in that folder.")] = False,
) -> None:
    """Run a whole simulated test over ROS 2: table, IMU, calibration and recorder, each its own process.

    Exit status 3: done, but the estimate is not to be trusted, or --adaptive did not reach its limits; stderr says why.
    """
    import time

    from sdimu_calibration.cli.console import console as make_console
    from sdimu_calibration.cli.processes import Children, own_domain, own_folder
    from sdimu_calibration.cli.watch_verb import outlined
    from sdimu_calibration.core.compiled import still_to_compile
    from sdimu_calibration.report.live_page.record import LiveRecord

    _check_choosing(test)
    page.check()
    check_stated(world.effect or ())
    options = _parameters(test, world, out)
    duration = _check(options)
    if test.adaptive is not None:
        duration = _choosing(options, test.adaptive, test.ask, test.tell or [])
    console = make_console()
    about = _about(options, test, duration, out)
    outline, first = outlined(about, None, ())
    record = LiveRecord(outline, about.folder, about.words)
    with own_folder(out), LivePage(page, record, console) as shown:
        begun = time.monotonic()
        with own_domain(out / "log", domain, about) as used, Children(out / "log") as children:
            _clear(out, test.followed, replace)
            console.print(f"ROS domain {used}", highlight=False)
            if still_to_compile():
                console.print("compiling the numerical loops, once on this machine: up to a minute without samples")
            _start(children, options, out / "bag", replace)
            shown.begin()
            streamed = _watch(console, children, outline, first, record)
        record.tell("the report is being made")
        wall = time.monotonic() - begun
        end = _tell_choices(console, out / "choices.json") if test.adaptive is not None else None
        result = _report(console, out, world.site, test)
        _say_measured(console, out, result, streamed, wall)
        record.end(ended(record.folder))
    _leave(result, test.adaptive, end)


def _about(options: dict[str, dict[str, Any]], test: LiveTest, duration: float, out: Path) -> RunningTest:
    """Say what is run to those that watch it (`sdimu watch`)."""
    from sdimu_calibration.cli.processes import RunningTest
    from sdimu_calibration.storage.files.config import load_plan

    stops = 0 if test.adaptive else len(load_plan(test.followed).dwell_s)
    start_ns = int(options["table"]["start_ns"])
    more = {"course": test.course, "site": options["calibration"]["site"], "diagnosed": test.diagnose}
    return RunningTest(str(out.resolve()), duration, stops, test.model, test.imu, start_ns, **more)


def _parameters(test: LiveTest, world: World, out: Path) -> dict[str, dict[str, Any]]:
    """Parameters of table, IMU and calibration node."""
    plan = test.followed
    return {
        "table": {"plan": plan, "table": world.table, "seed": test.seed, "speed": test.speed, "start_ns": START_NS},
        "imu": {
            "imu": test.imu,
            "site": world.site,
            "plan": plan,
            "seed": test.seed,
            "rate_hz": world.rate,
            "mount": world.mount or "",
            "mount_max_deg": world.mount_max,
            "effects": list(world.effects),
            "temperature": world.temperature or "",
            "truth_file": str(out / TRUTH),
        },
        # What the simulated gyros send is known, so the filter on the way need not wait for a turn.
        "calibration": {
            "site": world.site,
            "imu": test.imu,
            "model": test.model,
            "out": str(out),
            "gyro_unit": "rad/s",
            "gyro_sign": 1,
            "diagnose": test.diagnose,
        },
    }


def _leave(result: Calibration, goals: str | None, end: dict[str, Any] | None) -> None:
    """End with exit status 3 and lines on stderr where the result is not to be trusted, or goals were not reached."""
    short = end is not None and not end["reached"]
    if end is not None and short:
        typer.echo(f"sdimu: the limits of {goals} were not reached: {end['text']}", err=True)
    leave(result)
    if short:
        raise typer.Exit(NOT_TRUSTED)


def _check_choosing(test: LiveTest) -> None:
    """Refuse options that would have no effect."""
    for option, stated in (("--ask", test.ask), ("--tell", test.tell)):
        if stated and test.adaptive is None:
            raise DataError(f"{option}: only for a test that chooses its turns: state --adaptive GOALS, too")
    if test.plan is not None and test.adaptive is not None:
        raise DataError(
            f"--plan {test.plan} and --adaptive {test.adaptive}: a test follows a plan or chooses its turns; state one"
        )


def _clear(out: Path, plan: str = DEFAULT_PLAN, replace: bool = False) -> None:
    """Remove the results of an earlier run, once nothing refuses this one: `replace` is asked where there is a bag.

    The file of the plan that is to be followed stays.
    """
    from sdimu_calibration.storage.bags.bag_folder import check_room
    from sdimu_calibration.storage.bags.bag_metadata import METADATA
    from sdimu_calibration.storage.files.journal import JOURNAL
    from sdimu_sim.truth_file import check_truth_room

    bag, earlier = out / "bag", (out / "log" / "rate_table.yaml").is_file()
    if not earlier and (bag / METADATA).is_file():
        raise DataError(f"{bag}: sdimu run did not make this bag; move it, or name another folder with --out")
    check_room(bag, replace)
    check_truth_room(out / TRUTH, bag, replace=True)
    followed = _is_file(plan, out / PLAN)
    if not earlier:
        if not followed:
            check_plan_room(out)
        # The journal of a live test in that folder may be all that there is of it.
        put_aside(out / JOURNAL)
    for stale in ("result.json", "report.html", "diagnosis.json", JOURNAL, "choices.json"):
        (out / stale).unlink(missing_ok=True)
    if earlier and not followed:
        (out / PLAN).unlink(missing_ok=True)


def _check(options: dict[str, dict[str, Any]]) -> float:
    """Read everything once, so that a wrong option is one line before anything starts; length of the test (s)."""
    from rate_table_sim.core import table_motion
    from rate_table_sim.table_file import load_table
    from sdimu_calibration.storage.files.config import load_imu, load_plan, load_site
    from sdimu_calibration.storage.files.effect_file import extended_model
    from sdimu_sim.cli.options import mount_rad
    from sdimu_sim.temperature_file import load_temperature

    table, imu, calibration = options["table"], options["imu"], options["calibration"]
    plan = load_plan(table["plan"])
    motion = table_motion(plan, load_table(table["table"]), table["seed"])
    load_imu(imu["imu"])
    load_site(imu["site"])
    extended_model(calibration["model"], ())
    if imu["mount"]:
        mount_rad(imu["mount"])
    if imu["temperature"]:
        load_temperature(imu["temperature"])
    if not 0.0 <= table["speed"] < math.inf:
        raise DataError(f"--speed {table['speed']:g}: expected 0 or more")
    if not 10.0 <= imu["rate_hz"] <= 1000.0:
        raise DataError(f"--rate {imu['rate_hz']:g}: expected 10 to 1000 Hz")
    return float(motion.t[-1])


def _choosing(options: dict[str, dict[str, Any]], goals: str, ask: bool, tell: list[str]) -> float:
    """Let the table follow goals, and add the node that chooses them; longest length of the test (s)."""
    from sdimu_calibration.core.adaptive.goals import aimed
    from sdimu_calibration.storage.files.goal_file import load_goals

    options["table"]["follow_goals"] = True
    given = {key: value for key, value in options["calibration"].items() if key != "diagnose"}
    options["adaptive"] = {
        **given,
        "goals": goals,
        "table": options["table"]["table"],
        "allow_motion": True,
        "ask": ask,
        "tell": tell,
        "finish": True,
    }
    return 60.0 * aimed(load_goals(goals), tell).minutes


def _start(children: Children, options: dict[str, dict[str, Any]], bag: Path, replace: bool) -> None:
    """Start the four nodes; each waits for those it feeds, so their order does not matter."""
    recorder = {
        "out": str(bag),
        "replace": replace,
        "wait_for": ["/imu/data_raw", "/rate_table/status", "/calibration/coefficients"],
    }
    children.start("recorder", "sdimu_calibration.nodes.recorder_node", recorder)
    children.start("calibration", "sdimu_calibration.nodes.calibration_node", options["calibration"])
    children.start("sdimu", "sdimu_sim.nodes.sdimu_node", {**options["imu"], "consumers": 2})
    table = {**options["table"], "consumers": 1, "status_peers": 2, "joint_peers": 1}
    children.start("rate_table", "rate_table_sim.nodes.rate_table_node", table)
    if "adaptive" in options:
        children.start("adaptive", "sdimu_calibration.nodes.adaptive_node", options["adaptive"])


def _watch(console: Console, children: Children, test: Outline, sigmas: dict[str, float], record: LiveRecord) -> float:
    """Show the progress until every node has left; wall time (s) that the data took.

    `sigmas`: those at the begin (SI), by coefficient.
    """
    import time

    from sdimu_calibration.cli.watch import Watch
    from sdimu_calibration.nodes.monitor import Monitor

    monitor = Monitor(first=sigmas)
    moved = time.monotonic()
    first: float | None = None
    streamed = 0.0
    mark: tuple[Any, ...] = ()
    try:
        with Watch(console, test) as watch:
            while running := children.running():
                now_at = monitor.listen(0.1)
                now = time.monotonic()
                if first is None and now_at.table_s > 0.0:
                    first = now
                if first is not None and "sdimu" in running:
                    streamed = now - first
                seen = (now_at.table_s, now_at.filter_s, tuple(running))
                if seen != mark:
                    mark, moved = seen, now
                if now - moved > STALL_S:
                    raise DataError(f"nothing has moved for {STALL_S:.0f} s ({', '.join(running)} still running)")
                watch.show(now_at, "sdimu" in running, streamed)
                record.take(now_at, "sdimu" in running, streamed)
                record.carry_out(monitor.add)
    finally:
        monitor.close()
    return streamed


def _report(console: Console, out: Path, site: str, test: LiveTest) -> Calibration:
    """Diagnose the bag, print the table with the truth, write diagnosis and page."""
    from sdimu_calibration.cli.console import say
    from sdimu_calibration.cli.diagnosis_text import cost_lines, print_out_of_sight
    from sdimu_calibration.core.diagnosis.diagnose import climb
    from sdimu_calibration.core.diagnosis.summary import summarise
    from sdimu_calibration.core.estimation.solve import solve
    from sdimu_calibration.report.cost import in_use_entry
    from sdimu_calibration.report.page import write_report
    from sdimu_calibration.report.report_extras import report_extras
    from sdimu_calibration.report.table import rich_table, rows
    from sdimu_calibration.storage.files.config import load_imu
    from sdimu_calibration.storage.files.diagnosis_file import write_diagnosis
    from sdimu_calibration.storage.files.effect_file import added_to, extended_model, without_file
    from sdimu_calibration.storage.files.reference_file import read_reference, read_truth
    from sdimu_calibration.storage.files.result_file import read_result
    from sdimu_calibration.storage.opening import open_test
    from sdimu_calibration.storage.trace import traced

    result = read_result(out / "result.json")
    truth = read_truth(out / TRUTH, result.body_frame)
    imu, model = test.imu, test.model
    with console.status("diagnosing") if console.is_terminal else nullcontext():
        opened = open_test(out / "bag", site, load_imu(imu))
        added = added_to(model, result.model, result.origin.effect_files)
        wanted = extended_model(model, added)
        fit = solve(opened, wanted)
        diagnosis = climb(fit)
        summary, more = without_scolding(summarise(diagnosis), test.adaptive), report_extras(diagnosis, fit)
    fitted = Fitted(None if model == DEFAULT_MODEL else model, add=added or None)
    asked = Asked.of((out / "bag",), out, Place(site, imu), fitted)
    with written_together(out) as part:
        write_diagnosis(part / "diagnosis.json", summary, in_use=in_use_entry(more))
        _write_plan(part, out, test, summary)
        write_report(
            part / "report.html",
            result,
            title=test.title,
            truth=truth,
            reference=read_reference(),
            summary=summary,
            more=more,
            trace=traced([out / "bag"], sys.argv[1:], site=site, imu=imu, model=model),
            spell=partial(spelled, asked=asked),
        )
    shown = rich_table(rows(result, truth, read_reference()), f"body frame: {result.body_frame}")
    console.print(shown, soft_wrap=True)
    for text in (summary.diagnosis.sentence, *cost_lines(summary, more)):
        console.print(text, soft_wrap=True, highlight=False)
    print_out_of_sight(console, summary)
    print_advice(console, summary.advice, asked)
    if lost := without_file(result, wanted):
        say(console, f"note: {lost}")
    return result


def without_scolding(summary: DiagnosisSummary, goals: str | None) -> DiagnosisSummary:
    """Leave out advice to drive other turns where the test itself chose them: its goals ask for what they show.

    Why an effect is not seen stays, without what to drive in its place.
    """
    from dataclasses import replace

    from sdimu_calibration.core.advice import Kind

    if goals is None:
        return summary
    about_turns = {Kind.SIGNED_TURNS, Kind.TWO_RATES}
    unseen = tuple(replace(one, because=one.because._replace(drive="")) for one in summary.untestable)
    advice = tuple(one for one in summary.advice if one.kind not in about_turns)
    return replace(summary, advice=advice, untestable=unseen)


def _write_plan(part: Path, out: Path, test: LiveTest, summary: DiagnosisSummary) -> None:
    """Leave the plan that was run, to which the advice of the diagnosis refers; chosen turns as the motion showed them.

    `part`: where files are written that then go to `out` together.
    """
    from sdimu_calibration.core.diagnosis.plan_seen import as_plan
    from sdimu_calibration.storage.files.config import load_plan
    from sdimu_calibration.storage.files.plan_file import write_plan

    if test.adaptive is not None:
        plan, remark = (as_plan(summary.plan), f"{PLAN_CHOSEN} {test.adaptive}, as the motion showed them")
    else:
        plan, remark = load_plan(test.followed), f"{PLAN_RUN}: {test.followed}"
    # A plan of the user's own in this place stays as it is written.
    if plan is not None and not _is_file(test.followed, out / PLAN):
        write_plan(part / PLAN, plan, [remark])


def _is_file(name: str, file: Path) -> bool:
    """Tell whether a plan is named by the path of a file."""
    return same_file(Path(name), file)


def _tell_choices(console: Console, path: Path) -> dict[str, Any]:
    """Print every choice with its reason, and give the last one, which ended the test."""
    from sdimu_calibration.core.plain_text import one_line
    from sdimu_calibration.core.recording import DataError
    from sdimu_calibration.storage.files.json_file import read_json

    choices = read_json(path, "sdimu-choices/1").get("choices")
    if not isinstance(choices, list) or not choices or not all(_is_choice(choice) for choice in choices):
        raise DataError(f"{path}: choices: expected those of an adaptive test; it was changed, or ended without one")
    for choice in choices:
        text = f"{choice['until_s'] / 60.0:5.1f} min  {choice['text']}"
        console.print(one_line(text), soft_wrap=True, markup=False, highlight=False)
    end: dict[str, Any] = choices[-1]
    return end


def _is_choice(choice: object) -> bool:
    """Whether an entry of choices.json has what is told of it."""
    from sdimu_calibration.storage.files.config import LONGEST_PLAN_S

    kinds = {"until_s": int | float, "text": str, "reached": bool}
    if not (isinstance(choice, dict) and all(isinstance(choice.get(key), kind) for key, kind in kinds.items())):
        return False
    # A whole number of JSON may be larger than any number of Python's.
    return bool(0.0 <= choice["until_s"] <= LONGEST_PLAN_S)


def _say_measured(console: Console, out: Path, result: Calibration, streamed: float, wall: float) -> None:
    """Say how fast it was and what was lost, counted by the stamps in the bag."""
    taken, lost = _samples(out / "bag")
    duration = result.data["duration_s"]
    pace = f"{duration / streamed:.0f} times real time, " if streamed > 0.0 else ""
    console.print(
        f"{duration:.0f} s of data: {pace}{wall:.1f} s with start and last calibration ({duration / wall:.0f} times); "
        f"{taken} samples recorded, {lost} lost",
        soft_wrap=True,
        highlight=False,
    )
    console.print(f"results in {out}", soft_wrap=True)


def _samples(bag: Path) -> tuple[int, int]:
    """Count the samples in a bag, and how many the gaps between their stamps leave room for."""
    import numpy as np

    from sdimu_calibration.storage.bags.bag_file import raw_messages
    from sdimu_calibration.storage.bags.cdr import IMU, decode_imu
    from sdimu_calibration.storage.bags.topic_choice import Topics

    topic = Topics().imu
    stamps = np.unique(decode_imu(raw_messages(bag, {topic: IMU}, topic)[topic])[0])
    steps = np.diff(stamps)
    return len(stamps), int(np.sum(np.rint(steps / np.median(steps)) - 1))
