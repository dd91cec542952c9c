"""`sdimu diagnose`: is the model adequate, where does it fail, which effect is missing."""

from __future__ import annotations

import sys
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from sdimu_calibration.cli.console import answer, plain, say
from sdimu_calibration.cli.next_commands import PLAN, PLAN_SHOWN, Asked, check_plan_room, spelled
from sdimu_calibration.cli.opened import default_folder, explained, leave, opened, printing, tell
from sdimu_calibration.cli.option_groups import with_options
from sdimu_calibration.cli.options import BagsArgument, FitRequest, StatedOpening, results_in
from sdimu_calibration.cli.progress import bar
from sdimu_calibration.cli.set_run import SetRequest, diagnose_together, refuse_for_sets, the_only
from sdimu_calibration.core.data_error import DataError
from sdimu_calibration.storage.files.whole_file import written_together

if TYPE_CHECKING:
    from sdimu_calibration.cli.next_commands import Asked
    from sdimu_calibration.core.diagnosis.bootstrap import Null
    from sdimu_calibration.core.diagnosis.summary import DiagnosisSummary
    from sdimu_calibration.report.report_extras import ReportExtras
    from sdimu_calibration.storage.trace import Trace

NO_BOOTSTRAP = "--bootstrap: a handheld run learns its scatter, so there is no noise to draw; leave it out"


@dataclass(frozen=True)
class DiagnosisRequest(FitRequest):
    """What `sdimu diagnose` is asked."""

    add: Annotated[
        list[str] | None, typer.Option(metavar="EFFECT", help="Effect to add to the model: name or YAML file.")
    ] = None
    out: Annotated[Path | None, results_in("results; BAG_diagnosis")] = None
    attempt: Annotated[
        list[str] | None,
        typer.Option("--try", metavar="FILE", help="Effect of your own (YAML) to try with the catalogue."),
    ] = None
    grow: Annotated[bool, typer.Option("--grow", help="Refit with one found effect more at a time.")] = False
    bootstrap: Annotated[
        int, typer.Option(min=0, metavar="N", help="Repeat the search on N draws of pure noise: how often it errs.")
    ] = 0


@with_options
def diagnose(bags: BagsArgument = None, *, request: DiagnosisRequest, opening: StatedOpening) -> None:
    """Find what the model is missing; leaves diagnosis.json and report.html, and result.json of the model found.

    Exit status 3: done, but the estimate is not to be trusted; stderr says why.
    """
    from sdimu_calibration.cli.diagnosis_text import notes_of_diagnosis, print_summary
    from sdimu_calibration.core.diagnosis.bootstrap import bootstrap as repeat_on_noise
    from sdimu_calibration.core.diagnosis.diagnose import climb
    from sdimu_calibration.core.diagnosis.plan_seen import as_plan
    from sdimu_calibration.core.diagnosis.summary import summarise
    from sdimu_calibration.core.estimation.solve import solve
    from sdimu_calibration.report.cost import held_to_use
    from sdimu_calibration.report.report_extras import report_extras
    from sdimu_calibration.storage.files.effect_file import find_effects
    from sdimu_calibration.storage.files.model_choice import HANDHELD
    from sdimu_calibration.storage.trace import traced

    console = plain(stderr=request.as_json)
    printed = printing(console, request.pdf)
    extra = [effect for text in request.attempt or [] for effect in find_effects(text)]
    one = the_only(bags, opening, request)
    if isinstance(one, SetRequest):
        refuse_for_sets(opening, bootstrap=request.bootstrap, grow=request.grow)
        diagnose_together(one, extra)
        return
    bag, opening, request = one
    if request.bootstrap and request.asked_estimator == HANDHELD:
        raise DataError(NO_BOOTSTRAP)
    folder = request.out or default_folder(bag, "diagnosis")
    check_plan_room(folder)
    test, wanted, chosen = opened(console, bag, opening, request)
    if request.bootstrap and chosen == "auto" and test.why_handheld:
        raise DataError(NO_BOOTSTRAP)
    notes = test.recording.notes
    with explained(console, notes), bar(console) as progress:
        fit = solve(test, wanted, chosen, progress=progress)
        # The page shows it of this fit; known before fits in other noise are made of it, it holds for these, too.
        fit.held_out_rms()
        found = climb(fit, extra, progress, refits=request.grow)
        progress("navigation without aid", 0.97)
        more = report_extras(found, fit)
    found = held_to_use(found, more)
    summary = summarise(found)
    about = replace(Asked.of((bag,), folder, opening, request), has_plan=as_plan(summary.plan) is not None)
    null = None
    if request.bootstrap:
        with bar(console) as progress:
            null = repeat_on_noise(found, request.bootstrap, progress=progress)
    with bar(console):
        trace = traced([bag], sys.argv[1:], site=opening.site, imu=opening.imu, model=request.model)
        _write(Findings(about, f"Diagnosis of {bag.name}", summary, more, null), trace)
    print_summary(console, summary, about, more)
    if null is not None:
        say(console, f"bootstrap: {null.sentence}")
    printed(folder / "report.html")
    tell(console, (*notes, *(note for note in notes_of_diagnosis(found) if note not in notes)))
    say(console, f"results in {folder}")
    answer(folder / "diagnosis.json", request.as_json)
    leave(found.after, (found.verdict, summary.diagnosis.sentence))


@dataclass(frozen=True)
class Findings:
    """What a diagnosis leaves, and where."""

    about: Asked
    title: str
    """Of the page."""
    summary: DiagnosisSummary
    more: ReportExtras
    null: Null | None
    """Of a bootstrap."""


def _write(what: Findings, trace: Trace) -> None:
    """Leave diagnosis.json, result.json and report.html."""
    from sdimu_calibration.core.diagnosis.plan_seen import as_plan
    from sdimu_calibration.report.cost import in_use_entry
    from sdimu_calibration.report.page import write_report
    from sdimu_calibration.storage.files.diagnosis_file import write_diagnosis
    from sdimu_calibration.storage.files.plan_file import write_plan
    from sdimu_calibration.storage.files.result_file import write_result

    summary = what.summary
    found = summary.diagnosis
    with written_together(what.about.folder) as part:
        write_diagnosis(part / "diagnosis.json", summary, what.null, in_use_entry(what.more))
        write_result(part / "result.json", found.after, found.verdict)
        if (plan := as_plan(summary.plan)) is not None:
            write_plan(part / PLAN, plan, [f"{PLAN_SHOWN}, for: sdimu plan --plan"])
        write_report(
            part / "report.html",
            found.after,
            title=what.title,
            summary=summary,
            more=what.more,
            trace=trace,
            spell=partial(spelled, asked=what.about),
        )
