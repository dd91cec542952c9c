"""`sdimu export`: the result of a calibration in the forms that other programs read."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from sdimu_calibration.cli.console import plain
from sdimu_calibration.cli.opened import warn
from sdimu_calibration.cli.options import OwnEffectOption, checked_degc
from sdimu_calibration.core.data_error import DataError

_MOST_HZ = 1e6
"""Highest sample rate (Hz): no IMU sends faster."""


def export(
    result: Annotated[Path, typer.Argument(metavar="RESULT", help="result.json of a calibration, or its folder.")],
    form: Annotated[
        str,
        typer.Option(
            "--format",
            help="matrices, kalibr, openvins, imu_tk, px4, ardupilot, c-header, yaml, csv; noise alone: imu (what was "
            "learned, for --imu), kalibr-noise, gtsam.",
        ),
    ] = "matrices",
    out: Annotated[Path | None, typer.Option(help="File to write; beside the result by default.")] = None,
    imu: Annotated[
        str | None,
        typer.Option(
            help="IMU whose noise is written, where a form has a place for it; that of the calibration by default."
        ),
    ] = None,
    rate: Annotated[float, typer.Option(help="Sample rate, where a form has a place for it (Hz).")] = 100.0,
    temperature: Annotated[
        float | None, typer.Option(metavar="DEGC", help="Temperature at which matrices and biases are stated.")
    ] = None,
    effect: OwnEffectOption = None,
    replace: Annotated[bool, typer.Option("--replace", help="Replace a file that is already there.")] = False,
) -> None:
    """Write a result for another program: matrices, Kalibr, OpenVINS, GTSAM, imu_tk, PX4, ArduPilot, C, YAML or CSV.

    A result that is not to be trusted is written all the same; stderr says why it is not.
    """
    from functools import partial

    from sdimu_calibration.storage.bags.file_room import check_file_room
    from sdimu_calibration.storage.export import FORMS
    from sdimu_calibration.storage.export import export as write
    from sdimu_calibration.storage.files.config import find_config, names_of
    from sdimu_calibration.storage.files.effect_file import effect_files, effects_of_result
    from sdimu_calibration.storage.files.result_file import noise_for, read_judged_result

    if not 0.0 < rate <= _MOST_HZ:
        raise DataError(f"--rate {rate:g}: expected a sample rate above 0 to {_MOST_HZ:g} Hz")
    if temperature is not None:
        checked_degc("--temperature", temperature)
    calibration, doubts = read_judged_result(result)
    own = effects_of_result(calibration.model, effect or [])
    folder = result if result.is_dir() else result.parent
    name, kind = (FORMS[form].file_name, FORMS[form].kind) if form in FORMS else ("", "")
    specification, whose = noise_for(calibration, imu)
    sources = [folder / "result.json" if result.is_dir() else result, *effect_files(effect or [])]
    sources += [find_config("imu", imu)] if imu else []
    sources += [Path(calibration.origin.imu_file)] if calibration.origin.imu_file else []
    sources += [find_config("imu", calibration.origin.imu)] if calibration.origin.imu in names_of("imu") else []
    free = partial(check_file_room, option="--out", kind=kind, replace=replace, sources=sources)
    done = write(form, out or folder / name, calibration, specification, own, rate, temperature, free)
    console = plain()
    for text in done.missing:
        console.print(f"not in the file: {text}", soft_wrap=True, markup=False, highlight=False)
    if form in FORMS and FORMS[form].has_noise:
        console.print(f"noise densities are those of {whose}", soft_wrap=True, markup=False, highlight=False)
    console.print(f"body frame: {calibration.body_frame}; {' '.join(map(str, done.files))}", soft_wrap=True)
    warn(doubts)
