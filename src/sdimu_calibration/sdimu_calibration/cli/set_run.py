"""A joint fit or diagnosis of several bags: what `sdimu calibrate` and `sdimu diagnose` do with more than one."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from math import isnan
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

import typer

from sdimu_calibration.cli.console import answer, command, plain, say
from sdimu_calibration.cli.next_commands import NOT_LOOKED_FOR, TO_LEARN, Asked, print_advice, spelled
from sdimu_calibration.cli.opened import folder_for_result, leave, printing, tell
from sdimu_calibration.cli.options import FitRequest, StatedOpening
from sdimu_calibration.cli.progress import bar
from sdimu_calibration.core.note import MISFITS, topic_of, without_advice
from sdimu_calibration.storage.files.whole_file import written_together

if TYPE_CHECKING:
    from rich.console import Console

    from sdimu_calibration.core.effects.effect import Effect
    from sdimu_calibration.core.joint.member import Member
    from sdimu_calibration.core.joint.set_diagnosis import SetDiagnosis
    from sdimu_calibration.core.joint.set_fit import Run, SetOptions
    from sdimu_calibration.core.progress import Progress
    from sdimu_calibration.core.results import Calibration
    from sdimu_calibration.storage.recording_set import BagSource
    from sdimu_calibration.storage.trace import Trace

R = TypeVar("R", bound=FitRequest)


@dataclass(frozen=True)
class SetRequest:
    """What the user asks of a set."""

    bags: Sequence[Path]
    """None where a set file names them."""
    opening: StatedOpening
    """Of all recordings; what a set file says of one comes first."""
    request: FitRequest

    @property
    def file(self) -> Path | None:
        """Set file, in the place of bags."""
        return self.request.set_file


def single(bags: list[Path] | None, file: Path | None) -> Path | None:
    """Return the only bag; None where several are to be fitted together.

    Raises BadParameter when there is no bag, or bags stand beside a set file.
    """
    if file is not None and bags:
        raise typer.BadParameter("the file names the bags of its set: leave the bags out", param_hint="--set")
    if file is None and not bags:
        raise typer.BadParameter("name a bag, several bags of one unit, or --set FILE", param_hint="BAG")
    return bags[0] if file is None and bags is not None and len(bags) == 1 else None


def the_only(bags: list[Path] | None, opening: StatedOpening, request: R) -> tuple[Path, StatedOpening, R] | SetRequest:
    """Return the only recording with how it is opened and what is asked of it, or several as a set.

    A set file of one recording is that recording, with what the file says of it.
    """
    bag = single(bags, request.set_file)
    if bag is not None:
        return bag, opening, request
    if request.set_file is None:
        return SetRequest(bags or [], opening, request)
    from sdimu_calibration.core.estimation.solve import AUTO
    from sdimu_calibration.storage.recording_set import BagSource, load_set

    wanted = load_set(request.set_file, _as_stated(opening, request))
    source = wanted.members[0].open
    if len(wanted.members) > 1 or not isinstance(source, BagSource):
        return SetRequest((), opening, request)
    (member,) = wanted.members
    degc = None if source.reference_degc is None else f"{source.reference_degc!r} degC"
    opening = replace(
        opening,
        site=source.site,
        imu=source.imu,
        serial=opening.serial or member.serial or None,
        power_on=opening.power_on or member.power_on or None,
        reference_temperature=degc,
    )
    estimator = request.estimator if request.asked_estimator != AUTO else wanted.estimator
    return (
        source.bag,
        opening,
        replace(request, set_file=None, estimator=estimator, model=request.model or wanted.model),
    )


def _as_stated(opening: StatedOpening, request: FitRequest) -> BagSource:
    """Make what the options state of all recordings of a set."""
    from sdimu_calibration.storage.recording_set import BagSource

    return BagSource(
        Path(),
        opening.site,
        opening.imu,
        opening.source,
        request.handheld,
        opening.measured_noise,
        opening.reference_degc,
    )


def refuse_for_sets(opening: StatedOpening, **options: object) -> None:
    """Refuse options that are of one recording: those of an opening, and others by name."""
    own = {name: getattr(opening, name) for name in ("whole_turns", "rests", "exclude_stops", "exclude_times")}
    for name, value in (options | own).items():
        if value:
            raise typer.BadParameter(
                "is of one recording: run it with that bag alone, or leave it out",
                param_hint=f"--{name.replace('_', '-')}",
            )


def calibrate_together(asked: SetRequest) -> None:
    """Fit all recordings together; leaves result.json and report.html."""
    from sdimu_calibration.core.joint.set_fit import fit_set
    from sdimu_calibration.report.page import write_report
    from sdimu_calibration.storage.files.result_file import write_result
    from sdimu_calibration.storage.set_work import judged_outcome

    console = plain(stderr=asked.request.as_json)
    printed, folder = printing(console, asked.request.pdf), folder_for_result(_folder(asked, "calibration"))
    with _begun(console, asked) as (members, options, run, progress):
        result = _with_serial(judged_outcome(fit_set(members, options, run, progress=progress)), members)
        progress("done", 1.0)
    about = to_repeat(asked, folder)
    with written_together(folder) as part:
        write_result(part / "result.json", result)
        write_report(
            part / "report.html",
            result,
            title=page_title(asked, "Calibration", result),
            trace=_trace(asked),
            spell=partial(spelled, asked=about),
        )
    printed(folder / "report.html")
    _show(console, result)
    misfit = any(topic_of(note) in MISFITS for note in result.notes)
    say(console, TO_LEARN if misfit else NOT_LOOKED_FOR)
    command(console, about.command("diagnose"))
    say(console, f"results in {folder}")
    answer(folder / "result.json", asked.request.as_json)
    leave(result, to_diagnose=about.command("diagnose"))


def diagnose_together(asked: SetRequest, extra: Sequence[Effect]) -> None:
    """Find what the model of a set misses; leaves diagnosis.json, result.json and report.html."""
    from sdimu_calibration.report.cost import in_use_entry
    from sdimu_calibration.report.page import write_report
    from sdimu_calibration.report.report_extras import of_navigations
    from sdimu_calibration.storage.files.diagnosis_file import write_set_diagnosis
    from sdimu_calibration.storage.files.result_file import write_result

    console = plain(stderr=asked.request.as_json)
    printed = printing(console, asked.request.pdf)
    found = diagnosed_set(console, asked, extra)
    after = found.after
    folder = _folder(asked, "diagnosis")
    about = to_repeat(asked, folder)
    with written_together(folder) as part:
        write_set_diagnosis(part / "diagnosis.json", found, in_use_entry(of_navigations(found.ladder)))
        write_result(part / "result.json", after, found.verdict)
        write_report(
            part / "report.html",
            after,
            title=page_title(asked, "Diagnosis", after),
            of_set=found,
            trace=_trace(asked),
            spell=partial(spelled, asked=about),
        )
    printed(folder / "report.html")
    say(console, f"{found.verdict}: {found.sentence}")
    for text in _costs(found):
        say(console, text)
    _show(console, after)
    print_advice(console, found.advice, about)
    say(console, f"results in {folder}")
    answer(folder / "diagnosis.json", asked.request.as_json)
    leave(after, (found.verdict, found.sentence))


def _costs(found: SetDiagnosis) -> list[str]:
    """Say how far the error falls, model by model: metres without aid, then recordings that are left out."""
    from sdimu_calibration.report.cost import in_use
    from sdimu_calibration.report.report_extras import of_navigations

    use, errors = in_use(of_navigations(found.ladder)), found.ladder.errors
    lines = [] if use is None else [use.sentence]
    told = [f"{error:.3f} ({name})" for name, error in errors if not isnan(error)]
    if told:
        lines.append(f"held-out error, a recording left out at a time, in one noise: {' -> '.join(told)}")
    return lines


def to_repeat(asked: SetRequest, folder: Path) -> Asked:
    """Return what the next verb about the same set has to repeat; its results are in `folder`."""
    about = Asked.of(asked.bags or (), folder, asked.opening, asked.request)
    return replace(about, options=["--set", str(asked.file), *about.options]) if asked.file else about


def diagnosed_set(console: Console, asked: SetRequest, extra: Sequence[Effect]) -> SetDiagnosis:
    """Find what the model of a set misses."""
    from sdimu_calibration.core.joint.set_diagnosis import diagnose_set

    with _begun(console, asked) as (members, options, run, progress):
        found = diagnose_set(members, options, run, extra, progress)
        progress("done", 1.0)
    return replace(found, after=_with_serial(found.after, members))


@contextmanager
def _begun(console: Console, asked: SetRequest) -> Iterator[tuple[tuple[Member, ...], SetOptions, Run, Progress]]:
    """Members, options and runner of what is asked, with a bar that shows the recordings that are done."""
    from sdimu_calibration.storage.recording_set import load_set, set_of, set_options
    from sdimu_calibration.storage.set_work import set_runner

    opening, request = asked.opening, asked.request
    like = _as_stated(opening, request)
    wanted = set_of(asked.bags, like) if asked.file is None else load_set(asked.file, like)
    serial = opening.serial
    members = tuple(
        replace(m, serial=serial or m.serial, power_on=opening.power_on or m.power_on) for m in wanted.members
    )
    options = set_options(replace(wanted, members=members), request.model, request.add or [], request.asked_estimator)
    with bar(console) as progress:

        def told(done: int, of: int) -> None:
            progress(f"recordings {done} of {of}", done / of)

        kept = _folder(asked, "evidence")
        with set_runner(len(members), request.workers, kept, request.scheduler, told) as run:
            yield members, options, run, progress


def _folder(asked: SetRequest, what: str) -> Path:
    """Folder of results: --out, or beside the first bag or the set file; that of evidence inside --out."""
    if asked.request.out is not None:
        return asked.request.out / what if what == "evidence" else asked.request.out
    first = (asked.file or asked.bags[0]).resolve()
    return first.with_name(f"{first.stem if asked.file else first.name}_set_{what}")


def _trace(asked: SetRequest) -> Trace:
    from sdimu_calibration.storage.trace import traced

    place, model = asked.opening, asked.request.model
    return traced(asked.bags, sys.argv[1:], set=asked.file, site=place.site, imu=place.imu, model=model)


def page_title(asked: SetRequest, word: str, result: Calibration) -> str:
    """Say of how many recordings a page is, or of which set file; where some were refused, of how many of them."""
    from sdimu_calibration.core.results import of_recordings

    of_set = of_recordings(result)
    if asked.file is None:
        return f"{word} of {of_set.counted}"
    some = f" ({of_set.counted})" if of_set.left_out else ""
    return f"{word} of {asked.file.name}{some}"


def table_heading(result: Calibration) -> str:
    """Say what a table of coefficients is of, and which recordings could not be used."""
    from sdimu_calibration.core.results import of_recordings

    return f"{of_recordings(result).together}, body frame: {result.body_frame}"


def _with_serial(result: Calibration, members: Sequence[Member]) -> Calibration:
    return result.with_serial(next((m.serial for m in members if m.serial), ""))


def _show(console: Console, result: Calibration) -> None:
    """Print the table, the power-ons and what the user should know; the command of a diagnosis stands elsewhere."""
    from sdimu_calibration.core.site_reference import relative_line
    from sdimu_calibration.report.table import rich_table, rows

    console.print(rich_table(rows(result), table_heading(result)), soft_wrap=True)
    at = relative_line(result.references)
    tell(console, (*((at,) if at else ()), *without_advice(result.notes)))
