"""`sdimu diagnose`: is the model adequate, where does it fail, which effect is missing."""

from __future__ import annotations

import sys
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from sdimu_calibration.cli.console import JsonOption, answer, plain, say
from sdimu_calibration.cli.exclusion_options import ExcludeStops, ExcludeTimes, left_out
from sdimu_calibration.cli.options import (
    EstimatorOption,
    HandOption,
    ImuOption,
    ModelOption,
    NoiseOption,
    PowerOnOption,
    SerialOption,
    SiteOption,
    WholeTurnsOption,
    default_folder,
    explained,
    leave,
    opened,
    tell,
)
from sdimu_calibration.cli.set_run import (
    WORKERS,
    Bags,
    ReferenceOption,
    SchedulerOption,
    SetOption,
    SetRequest,
    WorkersOption,
    about_reference,
    diagnose_together,
    refuse_for_sets,
    single,
)
from sdimu_calibration.cli.source_options import (
    AccelSign,
    AccelUnit,
    GyroSign,
    GyroUnit,
    ImuTopic,
    JointTopic,
    StatusTopic,
    TemperatureTopic,
    source,
)

if TYPE_CHECKING:
    from sdimu_calibration.cli.next_commands import Asked
    from sdimu_calibration.core.diagnosis.bootstrap import Null
    from sdimu_calibration.core.diagnosis.summary import DiagnosisSummary
    from sdimu_calibration.core.progress import Progress
    from sdimu_calibration.storage.trace import Trace

NO_BOOTSTRAP = "--bootstrap: a handheld run learns its scatter, so there is no noise to draw; leave it out"


def diagnose(
    bags: Bags = None,
    model: ModelOption = None,
    site: SiteOption = None,
    imu: ImuOption = None,
    add: Annotated[
        list[str] | None, typer.Option(metavar="EFFECT", help="Effect to add to the model: name or YAML file.")
    ] = None,
    attempt: Annotated[
        list[str] | None,
        typer.Option("--try", metavar="FILE", help="Effect of your own (YAML) to try with the catalogue."),
    ] = None,
    grow: Annotated[bool, typer.Option("--grow", help="Refit with one found effect more at a time.")] = False,
    bootstrap: Annotated[
        int, typer.Option(min=0, metavar="N", help="Repeat the search on N draws of pure noise: how often it errs.")
    ] = 0,
    noise: NoiseOption = None,
    estimator: EstimatorOption = "auto",
    hand: HandOption = False,
    whole_turns: WholeTurnsOption = None,
    exclude_stops: ExcludeStops = None,
    exclude_times: ExcludeTimes = None,
    serial: SerialOption = None,
    power_on: PowerOnOption = None,
    out: Annotated[
        Path | None, typer.Option(file_okay=False, help="Folder of the results; BAG_diagnosis by default.")
    ] = None,
    set_file: SetOption = None,
    reference_temperature: ReferenceOption = None,
    workers: WorkersOption = WORKERS,
    scheduler: SchedulerOption = None,
    as_json: JsonOption = False,
    imu_topic: ImuTopic = None,
    status_topic: StatusTopic = None,
    joint_topic: JointTopic = None,
    temperature_topic: TemperatureTopic = None,
    accel_unit: AccelUnit = None,
    gyro_unit: GyroUnit = None,
    accel_sign: AccelSign = None,
    gyro_sign: GyroSign = None,
) -> None:
    """Find what the model is missing; leaves diagnosis.json and report.html, and result.json of the model found."""
    given = dict(locals())
    from sdimu_calibration.cli.diagnosis_text import notes_of_diagnosis, print_summary
    from sdimu_calibration.cli.next_commands import Asked
    from sdimu_calibration.cli.progress import bar
    from sdimu_calibration.core.diagnosis.bootstrap import bootstrap as repeat_on_noise
    from sdimu_calibration.core.diagnosis.diagnose import NOT_DIAGNOSABLE, climb
    from sdimu_calibration.core.diagnosis.summary import summarise
    from sdimu_calibration.core.estimation.solve import solve
    from sdimu_calibration.core.recording import DataError
    from sdimu_calibration.storage.files.effect_file import find_effects
    from sdimu_calibration.storage.files.model_choice import HANDHELD, named_estimator
    from sdimu_calibration.storage.trace import traced

    console = plain(stderr=as_json)
    asked = HANDHELD if hand else named_estimator(estimator, "--estimator")
    if asked == "classical":
        raise DataError(NOT_DIAGNOSABLE)
    if bootstrap and asked == HANDHELD:
        raise DataError(NO_BOOTSTRAP)
    extra = [effect for text in attempt or [] for effect in find_effects(text)]
    origin = source(
        imu_topic, status_topic, joint_topic, temperature_topic, accel_unit, gyro_unit, accel_sign, gyro_sign
    )
    bag = single(bags, set_file)
    if bag is None:
        refuse_for_sets(bootstrap=bootstrap, grow=grow, whole_turns=whole_turns, power_on=power_on,
                         exclude_stops=exclude_stops, exclude_times=exclude_times)
        diagnose_together(SetRequest(
            bags or [], set_file, model, site, imu, add or [], origin, asked, noise, out, workers, scheduler, serial,
            reference_temperature, as_json,
        ), extra)  # fmt: skip
        return
    test, wanted, chosen = opened(console, bag, model, site, imu, add, origin, asked, noise, whole_turns)
    test = left_out(test, exclude_stops, exclude_times)
    test = about_reference(replace(test, origin=test.origin.stated(serial, power_on)), reference_temperature)
    if bootstrap and chosen == "auto" and test.why_handheld:
        raise DataError(NO_BOOTSTRAP)
    notes = test.recording.notes
    with explained(console, notes), bar(console) as progress:
        found = climb(solve(test, wanted, chosen, progress=progress), extra, progress, refits=grow)
    summary = summarise(found)
    folder = out or default_folder(bag, "diagnosis")
    about = Asked.of((bag,), given, folder)
    print_summary(console, summary, about)
    null = None
    if bootstrap:
        with bar(console) as progress:
            null = repeat_on_noise(found, bootstrap, progress=progress)
        say(console, f"bootstrap: {null.sentence}")
    with bar(console) as progress:
        trace = traced([bag], sys.argv[1:], site=site, imu=imu, model=model)
        _write(about, f"Diagnosis of {bag.name}", summary, null, progress, trace)
    tell(console, (*notes, *(note for note in notes_of_diagnosis(found) if note not in notes)))
    say(console, f"results in {folder}")
    answer(folder / "diagnosis.json", as_json)
    leave(found.after, (found.verdict, found.sentence))


def _write(
    about: Asked, title: str, summary: DiagnosisSummary, null: Null | None, progress: Progress, trace: Trace
) -> None:
    """Leave diagnosis.json, result.json and report.html."""
    from sdimu_calibration.cli.next_commands import PLAN, as_plan, spelled
    from sdimu_calibration.report.page import write_report
    from sdimu_calibration.report.report_extras import report_extras
    from sdimu_calibration.storage.files.diagnosis_file import write_diagnosis
    from sdimu_calibration.storage.files.plan_file import write_plan
    from sdimu_calibration.storage.files.result_file import write_result
    from sdimu_calibration.storage.files.whole_file import written_together

    found = summary.diagnosis
    with written_together(about.folder) as part:
        write_diagnosis(part / "diagnosis.json", summary, null)
        write_result(part / "result.json", found.after, found.verdict)
        if (plan := as_plan(summary.plan)) is not None:
            write_plan(part / PLAN, plan, ["The plan as the motion showed it, for: sdimu plan --plan"])
        progress("navigation without aid", 0.5)
        more = report_extras(found)
        write_report(
            part / "report.html", found.after, title=title, summary=summary, more=more, trace=trace,
            spell=partial(spelled, asked=about),
        )  # fmt: skip
