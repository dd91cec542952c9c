"""A result in the forms that other programs read: one form a file, found by its name."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

from sdimu_calibration.core.compensation import LinearModel, linear_model
from sdimu_calibration.core.effects.effect import Effect
from sdimu_calibration.core.noise_term import NoiseTerm
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.results import Calibration
from sdimu_calibration.core.specification import ImuSpecification
from sdimu_calibration.core.stated_noise import not_stated
from sdimu_calibration.storage.export import (
    autopilot,
    c_header,
    csv_table,
    imu_tk,
    kalibr,
    matrices,
    noise_file,
    openvins,
    own_imu,
    yaml_file,
)
from sdimu_calibration.storage.export.shared import Source, cannot_hold
from sdimu_calibration.storage.files.whole_file import write_whole


class Form(NamedTuple):
    """A form of export."""

    file_name: str
    write: Callable[[Source], dict[str, str]]
    """`file_name`, `write`: default file name, and the texts of its files by what is added to the name."""
    cannot_hold: Callable[[LinearModel], list[str]]
    has_noise: bool = False
    kind: str = "sdimu-compensation"
    """`has_noise`, `kind`: whether noise is in it; format of its files, without a number, where it is one of ours."""
    forgets: Callable[[Sequence[NoiseTerm]], list[str]] = lambda _: []
    """What it cannot hold of noise that was learned, where it has a place for some."""


FORMS = {
    "matrices": Form("compensation.txt", matrices.texts, cannot_hold),
    "kalibr": Form("imu-kalibr.yaml", kalibr.texts, cannot_hold, True, forgets=noise_file.no_walk),
    "kalibr-noise": Form(
        "kalibr-imu.yaml", noise_file.kalibr_texts, noise_file.cannot_hold, True, forgets=noise_file.no_walk
    ),
    "openvins": Form("kalibr_imu_chain.yaml", openvins.texts, cannot_hold, True, forgets=noise_file.no_walk),
    "imu": Form("imu.yaml", own_imu.texts, own_imu.cannot_hold, True, "sdimu-imu", not_stated),
    "gtsam": Form("imu_metadata.txt", noise_file.gtsam_texts, noise_file.cannot_hold, True, forgets=noise_file.no_walk),
    "imu_tk": Form("imu_tk.calib", imu_tk.texts, imu_tk.cannot_hold),
    "c-header": Form("sdimu_compensation.h", c_header.texts, c_header.cannot_hold),
    "yaml": Form("compensation.yaml", yaml_file.texts, yaml_file.cannot_hold),
    "px4": Form("px4.params", autopilot.px4_texts, autopilot.cannot_hold),
    "ardupilot": Form("ardupilot.param", autopilot.ardupilot_texts, autopilot.cannot_hold),
    "csv": Form("coefficients.csv", csv_table.texts, csv_table.cannot_hold),
}


_NO_FORM = {
    "xsens": "units of Xsens keep the calibration of the factory, and no manual says how to write another: compensate "
    "their samples on the host (sdimu compensate; doc/using-the-result.md, Forms of export)"
}
"""Why there is no form for what people ask for, by its name in small letters."""


class Exported(NamedTuple):
    """What was written: files, and what they cannot hold, one line each."""

    files: tuple[Path, ...]
    missing: tuple[str, ...]


def export(
    form: str,
    path: Path,
    calibration: Calibration,
    imu: ImuSpecification,
    own: Sequence[Effect] = (),
    rate_hz: float = 100.0,
    temperature_degc: float | None = None,
    check: Callable[[Path], None] = lambda _: None,
) -> Exported:
    """Write a result in a form.

    Parameters
    ----------
    form : str
        Key of `FORMS`.
    path : Path
        File to make; forms of two files put ``-accel`` and ``-gyro`` before its suffix.
    imu : ImuSpecification
        White noise, where the form has a place for it.
    own : sequence of Effect
        Effects of the result that are in no catalogue.
    rate_hz : float
        Sample rate, where the form has a place for it.
    temperature_degc : float, optional
        Temperature at which matrices and biases are stated (deg C); that from which the coefficients count by default.
    check : callable
        Asked of every file before the first is written: raises where one must not be.
    """
    if form not in FORMS:
        why = _NO_FORM.get(form.lower(), f"expected one of {', '.join(FORMS)}")
        raise DataError(f"--format {form}: {why}")
    if path.is_dir():
        raise DataError(f"{path}: is a folder; name a file to write")
    linear = linear_model(calibration, own)
    if temperature_degc is not None:
        linear = linear.at(temperature_degc)
    missing = [*FORMS[form].cannot_hold(linear), *FORMS[form].forgets(calibration.noise)]
    source = Source(calibration, linear, imu, rate_hz, tuple(missing))
    texts = FORMS[form].write(source)
    files = {path.with_name(f"{path.stem}{addition}{path.suffix}"): text for addition, text in texts.items()}
    for file in files:
        check(file)
    for file, text in files.items():
        write_whole(file, text)
    return Exported(tuple(files), tuple(missing))
