"""`sdimu compensate`: the result of a calibration applied to a recording."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from sdimu_calibration.cli.console import plain
from sdimu_calibration.cli.opened import warn
from sdimu_calibration.cli.option_groups import with_options
from sdimu_calibration.cli.options import BagArgument, OwnEffectOption, ReplaceOption, checked_degc
from sdimu_calibration.cli.progress import bar
from sdimu_calibration.core.units import from_si


@dataclass(frozen=True)
class Taken:
    """What is taken out of the samples, and what is known of their temperature."""

    imu: Annotated[
        str | None,
        typer.Option(help="IMU whose noise goes in the covariances: name or path. That of the calibration by default."),
    ] = None
    effect: OwnEffectOption = None
    frame_id: Annotated[str | None, typer.Option(help="Frame of the samples; imu_ and the body frame.")] = None
    same_start: Annotated[
        bool, typer.Option("--same-start", help="Switched on as the calibrated recording was: functions of time hold.")
    ] = False
    start_temperature: Annotated[
        float | None, typer.Option(metavar="DEGC", help="Temperature at the start of the calibrated recording.")
    ] = None


@with_options
def compensate(
    bag: BagArgument,
    result: Annotated[Path, typer.Option(help="result.json of a calibration, or its folder.")],
    out: Annotated[Path, typer.Option(help="Bag (folder) to write: /imu/data and the other topics of BAG.")],
    taken: Taken,
    replace: ReplaceOption = False,
) -> None:
    """Take the errors out of a recording: /imu/data_raw to /imu/data with covariances.

    A result that is not to be trusted is applied all the same; stderr says why it is not.
    """
    from sdimu_calibration.core.compensation import compensator
    from sdimu_calibration.storage.bags.bag_reader import read_recording
    from sdimu_calibration.storage.bags.compensated_bag import frame_of, write_compensated
    from sdimu_calibration.storage.files.effect_file import effects_of_result
    from sdimu_calibration.storage.files.result_file import noise_for, read_judged_result

    console = plain()
    at = None if taken.start_temperature is None else checked_degc("--start-temperature", taken.start_temperature)
    calibration, doubts = read_judged_result(result)
    own = effects_of_result(calibration.model, taken.effect or [])
    specification, whose = noise_for(calibration, taken.imu)
    recording = read_recording(bag)
    using = compensator(
        calibration,
        specification,
        own=own,
        has_temperature=recording.temperature is not None,
        same_start=taken.same_start,
        start_temperature=at,
    )
    frame = taken.frame_id or frame_of(calibration.body_frame)
    with bar(console) as progress:
        done = write_compensated(bag, recording, using, out, frame, replace=replace, progress=progress)
    rate, force = from_si(done.largest_rate, "deg/h"), from_si(done.largest_force, "ug")
    beyond = "" if recording.temperature is None else using.beyond(recording.temperature.value)
    for note in (*recording.notes, *filter(None, [beyond])):
        console.print(f"note: {note}", soft_wrap=True, markup=False, highlight=False)
    for reason in using.left_out:
        console.print(f"not compensated: {reason}", soft_wrap=True, markup=False, highlight=False)
    console.print(
        f"{out}: {done.samples} samples in frame {frame}; changed by up to {rate:.4g} deg/h and {force:.4g} ug",
        soft_wrap=True,
        highlight=False,
    )
    console.print(f"noise in the covariances is that of {whose}", soft_wrap=True, markup=False, highlight=False)
    warn(doubts)
