"""`sdimu diagnose`: is the model adequate, where does it fail, which effect is missing."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

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


def diagnose(
    bag: Annotated[Path, typer.Argument(metavar="BAG", help="rosbag2 folder or .mcap file.")],
    model: Annotated[
        str | None, typer.Option(help="Model to examine: name in config/model or path; baseline (by hand: hand).")
    ] = None,
    site: Annotated[
        str | None, typer.Option(help="Where the test was: name in config/site or path; daejeon (by hand: none).")
    ] = None,
    imu: Annotated[str, typer.Option(help="Specification of the IMU: name in config/imu or path.")] = "dtg",
    add: Annotated[
        list[str] | None, typer.Option(metavar="EFFECT", help="Effect in the model besides: name or YAML file.")
    ] = None,
    attempt: Annotated[
        list[str] | None,
        typer.Option("--try", metavar="FILE", help="Effect of your own (YAML) to try with the catalogue."),
    ] = None,
    grow: Annotated[bool, typer.Option("--grow", help="Add effects one at a time by real refits.")] = False,
    bootstrap: Annotated[
        int, typer.Option(min=0, metavar="N", help="Repeat the search on N draws of pure noise: how often it errs.")
    ] = 0,
    noise: Annotated[
        str | None, typer.Option(help="estimated: white noise from the rests of the recording, not from --imu.")
    ] = None,
    estimator: Annotated[str, typer.Option(help="filter, hand; auto: filter or hand.")] = "auto",
    hand: Annotated[bool, typer.Option("--hand", help="Moved by hand: the same as --estimator hand.")] = False,
    out: Annotated[Path | None, typer.Option(help="Folder of the results; BAG_diagnosis by default.")] = None,
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
    from rich.console import Console

    from sdimu_calibration.cli.calibrate import (
        DIAGNOSED,
        HAND_CHOSEN,
        check_estimator,
        check_options,
        chosen_estimator,
        default_folder,
        measured,
    )
    from sdimu_calibration.cli.diagnose_with import Asked, diagnose_handheld_run, diagnose_navigated
    from sdimu_calibration.core.recording import DataError
    from sdimu_calibration.storage.config import load_imu
    from sdimu_calibration.storage.effect_file import extended_model, find_effects
    from sdimu_calibration.storage.opening import open_test

    console = Console()
    check_estimator(estimator, DIAGNOSED)
    check_options(model, add, site)
    specification = load_imu(imu)
    extra = [effect for text in attempt or [] for effect in find_effects(text)]
    origin = source(
        imu_topic, status_topic, joint_topic, temperature_topic, accel_unit, gyro_unit, accel_sign, gyro_sign
    )
    chosen = "hand" if hand else estimator
    handheld = None if chosen == "auto" else chosen == "hand"
    recording, specification, where = open_test(bag, site, specification, origin, handheld, measured(noise))
    folder, title = out or default_folder(bag, "diagnosis"), f"Diagnosis of {bag.name}"
    by_hand = chosen_estimator(chosen, recording, specification) == "hand"
    wanted = extended_model(model or ("hand" if by_hand else "baseline"), add or [])
    if by_hand:
        if not (hand or estimator == "hand"):
            console.print(HAND_CHOSEN, soft_wrap=True)
        if bootstrap:
            raise DataError("--bootstrap: a run by hand learns its scatter, so there is no noise to draw; leave it out")
    asked = Asked(recording, where, specification, wanted, extra, folder, title)
    if by_hand:
        diagnose_handheld_run(console, asked)
    else:
        diagnose_navigated(console, asked, grow, bootstrap)
    console.print(f"results in {folder}", soft_wrap=True)
