"""A joint fit or diagnosis of several bags: what `sdimu calibrate` and `sdimu diagnose` do with more than one."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from sdimu_calibration.cli.console import answer, plain, say
from sdimu_calibration.cli.next_commands import Asked, print_advice, spelled
from sdimu_calibration.cli.options import leave, tell

if TYPE_CHECKING:
    from rich.console import Console

    from sdimu_calibration.core.effects.effect import Effect
    from sdimu_calibration.core.estimation.prepared_test import PreparedTest
    from sdimu_calibration.core.joint.member import Member
    from sdimu_calibration.core.joint.set_diagnosis import SetDiagnosis
    from sdimu_calibration.core.joint.set_fit import Run, SetOptions
    from sdimu_calibration.core.progress import Progress
    from sdimu_calibration.core.results import Calibration
    from sdimu_calibration.storage.opening import Source
    from sdimu_calibration.storage.trace import Trace

_PANEL = "Several recordings of one unit"
Bags = Annotated[
    list[Path] | None,
    typer.Argument(metavar="BAG...", help="rosbag2 folder or .mcap file; several are fitted together as one unit."),
]
SetOption = Annotated[
    Path | None,
    typer.Option("--set", metavar="FILE", help="Set of recordings (sdimu set init).", rich_help_panel=_PANEL),
]
WorkersOption = Annotated[
    int, typer.Option(min=1, help="Processes that read recordings of a set.", rich_help_panel=_PANEL)
]
SchedulerOption = Annotated[
    str | None, typer.Option(metavar="ADDRESS", help="dask scheduler that reads them instead.", rich_help_panel=_PANEL)
]
ReferenceOption = Annotated[
    str | None,
    typer.Option(
        "--reference-temperature", metavar="T", help="From which temperature effects count, such as 20 degC.",
        rich_help_panel=_PANEL,
    ),
]  # fmt: skip
WORKERS = 2
"""Number of processes by default: the cores of a small machine."""


@dataclass(frozen=True)
class SetRequest:
    """What the user asks of a set; entries as the options of the same names.

    Attributes
    ----------
    bags : sequence of Path
    file : Path or None
    model, site, imu, estimator, noise, out, scheduler, serial, reference
    add : list of str
    source : Source
    workers : int
    as_json : bool
        Print the answer as JSON; words go to stderr.
    """

    bags: Sequence[Path]
    file: Path | None
    model: str | None
    site: str | None
    imu: str | None
    add: Sequence[str]
    source: Source
    estimator: str
    noise: str | None
    out: Path | None
    workers: int
    scheduler: str | None
    serial: str | None
    reference: str | None
    as_json: bool = False


def single(bags: list[Path] | None, file: Path | None) -> Path | None:
    """Return the only bag; None where several are to be fitted together.

    Raises
    ------
    BadParameter
        When there is no bag, or bags stand beside a set file.
    """
    if file is not None and bags:
        raise typer.BadParameter("the file names the bags of its set: leave the bags out", param_hint="--set")
    if file is None and not bags:
        raise typer.BadParameter("name a bag, several bags of one unit, or --set FILE", param_hint="BAG")
    return bags[0] if file is None and bags is not None and len(bags) == 1 else None


def about_reference(test: PreparedTest, reference: str | None) -> PreparedTest:
    """Let the temperature effects of a single recording count from ``--reference-temperature``."""
    from sdimu_calibration.core.units import parse_quantity
    from sdimu_calibration.storage.recording_set import counted_from

    return test if reference is None else counted_from(test, parse_quantity(reference, "degC"))


def refuse_for_sets(**options: object) -> None:
    """Refuse options that are of one recording.

    Raises
    ------
    BadParameter
        When one of them is stated.
    """
    for name, value in options.items():
        if value:
            raise typer.BadParameter(
                "is of one recording: state it for each in the set file (--set)" if name == "power_on"
                else "is of one recording: run it with that bag alone, or leave it out",
                param_hint=f"--{name.replace('_', '-')}",
            )


def calibrate_together(asked: SetRequest) -> None:
    """Fit all recordings together; leaves result.json and report.html."""
    from sdimu_calibration.core.joint.set_fit import fit_set
    from sdimu_calibration.core.joint.set_result import set_outcome
    from sdimu_calibration.report.page import write_report
    from sdimu_calibration.storage.files.result_file import write_result
    from sdimu_calibration.storage.files.whole_file import written_together

    console = plain(stderr=asked.as_json)
    with _begun(console, asked) as (members, options, run, progress):
        result = _with_serial(set_outcome(fit_set(members, options, run, progress=progress)), members)
        progress("done", 1.0)
    folder = _folder(asked, "calibration")
    with written_together(folder) as part:
        write_result(part / "result.json", result)
        write_report(part / "report.html", result, title=page_title(asked, "Calibration", result), trace=_trace(asked))
    _show(console, result)
    say(console, f"results in {folder}")
    answer(folder / "result.json", asked.as_json)
    leave(result)


def diagnose_together(asked: SetRequest, extra: Sequence[Effect]) -> None:
    """Find what the model of a set misses; leaves set.json, result.json and report.html."""
    from sdimu_calibration.report.page import write_report
    from sdimu_calibration.storage.files.diagnosis_file import write_set_diagnosis
    from sdimu_calibration.storage.files.result_file import write_result
    from sdimu_calibration.storage.files.whole_file import written_together

    console = plain(stderr=asked.as_json)
    found, members = diagnosed_set(console, asked, extra)
    after = _with_serial(found.after, members)
    folder = _folder(asked, "diagnosis")
    about = Asked.of(asked.bags, {"site": asked.site, "imu": asked.imu}, folder)
    with written_together(folder) as part:
        write_set_diagnosis(part / "set.json", found)
        write_result(part / "result.json", after, found.verdict)
        write_report(
            part / "report.html", after, title=page_title(asked, "Diagnosis", after), of_set=found, trace=_trace(asked),
            spell=partial(spelled, asked=about),
        )  # fmt: skip
    _show(console, after, diagnosed=True)
    say(console, f"{found.verdict}: {found.sentence}")
    print_advice(console, found.advice, about)
    say(console, f"results in {folder}")
    answer(folder / "set.json", asked.as_json)
    leave(after, (found.verdict, found.sentence))


def diagnosed_set(
    console: Console, asked: SetRequest, extra: Sequence[Effect]
) -> tuple[SetDiagnosis, tuple[Member, ...]]:
    """Find what the model of a set misses; give its recordings, too."""
    from sdimu_calibration.core.joint.set_diagnosis import diagnose_set

    with _begun(console, asked) as (members, options, run, progress):
        found = diagnose_set(members, options, run, extra, progress)
        progress("done", 1.0)
    return found, members


@contextmanager
def _begun(
    console: Console, asked: SetRequest
) -> Iterator[tuple[tuple[Member, ...], SetOptions, Run, Progress]]:
    """Members, options and runner of what is asked, with a bar that shows the recordings that are done."""
    from sdimu_calibration.cli.progress import bar
    from sdimu_calibration.core.units import parse_quantity
    from sdimu_calibration.storage.files.model_choice import HANDHELD, named_estimator
    from sdimu_calibration.storage.recording_set import BagSource, load_set, set_of, set_options
    from sdimu_calibration.storage.set_work import set_runner

    estimator = named_estimator(asked.estimator, "--estimator")
    reference = None if asked.reference is None else parse_quantity(asked.reference, "degC")
    handheld = None if estimator == "auto" else estimator == HANDHELD
    like = BagSource(
        Path(), asked.site, asked.imu, asked.source, handheld, asked.noise is not None, reference,
    )  # fmt: skip
    wanted = set_of(asked.bags, like) if asked.file is None else load_set(asked.file, like)
    serial = asked.serial
    members = tuple(m if serial is None else replace(m, serial=serial) for m in wanted.members)
    options = set_options(replace(wanted, members=members), asked.model, asked.add, estimator)
    with bar(console) as progress:
        def told(done: int, of: int) -> None:
            progress(f"recordings {done} of {of}", done / of)

        kept = _folder(asked, "evidence")
        with set_runner(len(members), asked.workers, kept, asked.scheduler, told) as run:
            yield members, options, run, progress


def _folder(asked: SetRequest, what: str) -> Path:
    """Folder of results: --out, or beside the first bag or the set file; that of evidence inside --out."""
    if asked.out is not None:
        return asked.out / what if what == "evidence" else asked.out
    first = (asked.file or asked.bags[0]).resolve()
    return first.with_name(f"{first.stem if asked.file else first.name}_set_{what}")


def _trace(asked: SetRequest) -> Trace:
    from sdimu_calibration.storage.trace import traced

    return traced(asked.bags, sys.argv[1:], set=asked.file, site=asked.site, imu=asked.imu, model=asked.model)


def page_title(asked: SetRequest, word: str, result: Calibration) -> str:
    """Say of how many recordings a page is, or of which set file; where some were refused, of how many of them."""
    counted = f"{count_in_words(result)} recordings"
    if asked.file is None:
        return f"{word} of {counted}"
    some = f" ({counted})" if result.of_set and result.of_set.left_out else ""
    return f"{word} of {asked.file.name}{some}"


def table_heading(result: Calibration) -> str:
    """Say what a table of coefficients is of, and which recordings could not be used."""
    refused = ", ".join(name for name, _ in result.of_set.left_out) if result.of_set else ""
    without = f", without {refused}" if refused else ""
    return f"{count_in_words(result)} recordings together{without}, body frame: {result.body_frame}"


def count_in_words(result: Calibration) -> str:
    """Count the recordings of a joint result: ``3``, or ``2 of 3`` where one was left out."""
    if result.of_set is None:
        return "0"
    used, refused = len(result.of_set.recordings), len(result.of_set.left_out)
    return f"{used} of {used + refused}" if refused else f"{used}"


def _with_serial(result: Calibration, members: Sequence[Member]) -> Calibration:
    return result.with_serial(next((m.serial for m in members if m.serial), ""))


def _show(console: Console, result: Calibration, diagnosed: bool = False) -> None:
    """Print the table, the power-ons and what the user should know."""
    from sdimu_calibration.core.note import without_advice
    from sdimu_calibration.report.table import rich_table, rows

    console.print(rich_table(rows(result), table_heading(result)), soft_wrap=True)
    tell(console, without_advice(result.notes) if diagnosed else result.notes)
