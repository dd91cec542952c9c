"""`sdimu calibrate`: a bag to coefficients."""

from __future__ import annotations

import sys
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from sdimu_calibration.cli.console import JsonOption, answer, command, plain, say
from sdimu_calibration.cli.exclusion_options import ExcludeStops, ExcludeTimes, left_out
from sdimu_calibration.cli.next_commands import Asked, spelled
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
    calibrate_together,
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
from sdimu_calibration.core.note import MISFITS, topic_of


def calibrate(
    bags: Bags = None,
    model: ModelOption = None,
    site: SiteOption = None,
    imu: ImuOption = None,
    add: Annotated[
        list[str] | None,
        typer.Option(
            metavar="EFFECT",
            help="Effect to add to the model: a name, one of its coefficients, or a YAML file; may be repeated.",
        ),
    ] = None,
    noise: NoiseOption = None,
    out: Annotated[
        Path | None, typer.Option(file_okay=False, help="Folder of the results; BAG_calibration by default.")
    ] = None,
    truth: Annotated[Path | None, typer.Option(help="Truth of a simulation, to show the errors.")] = None,
    estimator: EstimatorOption = "auto",
    hand: HandOption = False,
    whole_turns: WholeTurnsOption = None,
    exclude_stops: ExcludeStops = None,
    exclude_times: ExcludeTimes = None,
    serial: SerialOption = None,
    power_on: PowerOnOption = None,
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
    """Estimate the coefficients from a recording; leaves result.json and report.html."""
    given = dict(locals())
    from sdimu_calibration.cli.progress import bar
    from sdimu_calibration.core.estimation.outcome import outcome
    from sdimu_calibration.core.estimation.solve import solve
    from sdimu_calibration.core.units import STANDARD_GRAVITY
    from sdimu_calibration.report.page import write_report
    from sdimu_calibration.report.table import rich_table, rows
    from sdimu_calibration.storage.files.reference_file import read_truth
    from sdimu_calibration.storage.files.result_file import write_result
    from sdimu_calibration.storage.files.whole_file import written_together
    from sdimu_calibration.storage.trace import traced

    console = plain(stderr=as_json)
    origin = source(
        imu_topic, status_topic, joint_topic, temperature_topic, accel_unit, gyro_unit, accel_sign, gyro_sign
    )
    if truth is not None and estimator == "classical":
        raise typer.BadParameter(
            "the classical estimator answers in the table's axes, in which no truth is kept: leave it out, or see "
            "sdimu study mount", param_hint="--truth",
        )  # fmt: skip
    asked = "handheld" if hand else estimator
    bag = single(bags, set_file)
    if bag is None:
        refuse_for_sets(truth=truth, whole_turns=whole_turns, power_on=power_on,
                         exclude_stops=exclude_stops, exclude_times=exclude_times)
        calibrate_together(SetRequest(
            bags or [], set_file, model, site, imu, add or [], origin, asked, noise, out, workers,
            scheduler, serial, reference_temperature, as_json,
        ))  # fmt: skip
        return
    test, wanted, chosen = opened(
        console, bag, model, site, imu, add, origin, asked, noise, whole_turns
    )
    test = left_out(test, exclude_stops, exclude_times)
    test = about_reference(replace(test, origin=test.origin.stated(serial, power_on)), reference_temperature)
    notes = test.recording.notes
    with explained(console, notes), bar(console) as progress:
        fit = solve(test, wanted, chosen, progress=progress)
        result = outcome(fit)
        progress("done", 1.0)
    # Without a place gravity is a convention, and the truth is compared at it.
    taken = STANDARD_GRAVITY if test.site is None else None
    true = None if truth is None else read_truth(truth, result.body_frame, taken)
    folder = out or default_folder(bag)
    about = Asked.of((bag,), given, folder)
    with written_together(folder) as part:
        write_result(part / "result.json", result)
        trace = traced([bag], sys.argv[1:], site=site, imu=imu, model=model)
        write_report(
            part / "report.html", result, title=f"Calibration of {bag.name}", truth=true, fit=fit, trace=trace,
            spell=partial(spelled, asked=about),
        )  # fmt: skip
    console.print(rich_table(rows(result, true), f"body frame: {result.body_frame}"), soft_wrap=True)
    tell(console, (*notes, *(note for note in result.notes if note not in notes)))
    if any(topic_of(note) in MISFITS for note in result.notes):
        say(console, "To learn what the model misses:")
        command(console, about.command("diagnose"))
    say(console, f"results in {folder}")
    answer(folder / "result.json", as_json)
    leave(result)
