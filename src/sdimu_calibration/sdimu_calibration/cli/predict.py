"""`sdimu predict`: what a plan will tell, before it is run."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from sdimu_calibration.cli.console import answer, plain, say
from sdimu_calibration.cli.options import ImuNameOption, JsonOption, ModelOption, outside_recordings
from sdimu_calibration.cli.wide_table import print_table
from sdimu_calibration.core.data_error import DataError
from sdimu_calibration.storage.files.whole_file import written_together

if TYPE_CHECKING:
    from sdimu_calibration.core.plan import Plan
    from sdimu_calibration.core.planning.noise_set import NoiseSet
    from sdimu_calibration.core.planning.predict import Prediction
    from sdimu_calibration.core.specification import ImuSpecification, Model, Site

_MOUNT = "Rotation of the IMU on the table: degrees about every axis, or 'X,Y,Z'."
_NOISE = "Noise that the filter assumes: name in config/noise (paper) or path; by default the IMU's own."


def predict(
    plan: Annotated[str, typer.Option(help="Test plan: name in config/plan or path.")] = "kim18",
    imu: ImuNameOption = "dtg",
    site: Annotated[str, typer.Option(help="Where the test will be: name in config/site or path.")] = "daejeon",
    model: ModelOption = "baseline",
    mount: Annotated[str | None, typer.Option(metavar="DEG", help=_MOUNT)] = None,
    noise: Annotated[str | None, typer.Option(help=_NOISE)] = None,
    out: Annotated[
        Path, typer.Option(file_okay=False, callback=outside_recordings, help="Folder of the results.")
    ] = Path("out/predict"),
    as_json: JsonOption = False,
) -> None:
    """Simulate the covariance of a test; leaves prediction.json and prediction.html."""
    from sdimu_calibration.core.batch.batch import bound_covariance
    from sdimu_calibration.core.planning.predict import predict as simulate
    from sdimu_calibration.report.prediction import COLUMNS, coefficient_rows, write_page
    from sdimu_calibration.storage.files.config import load_imu, load_model, load_plan, load_site
    from sdimu_calibration.storage.files.noise_file import load_noise
    from sdimu_calibration.storage.files.prediction_file import write_prediction

    console = plain(stderr=as_json)
    what = load_plan(plan), load_site(site), load_imu(imu), load_model(model)
    assumed = None if noise is None else load_noise(noise)
    printed = _published(assumed)
    at = mount or (next(iter(printed)).removesuffix(" deg") if printed else "0")
    prediction = simulate(*what, mount_rad=_radians(at), noise=assumed, bound=bound_covariance)
    about: dict[str, Any] = {"plan": what[0].name, "imu": what[2].name, "site": site, "mount_deg": at}
    about["noise"] = assumed.name if assumed else "the IMU's own"
    published = None
    if assumed is not None and printed:
        rows = _beside(what, assumed, printed, prediction)
        published = tuple(printed), rows
    with written_together(out) as part:
        write_prediction(part / "prediction.json", prediction, about)
        write_page(part / "prediction.html", prediction, about, published)
    if assumed is not None and published is not None:
        headings = ("largest of the axes", *published[0], "off by", "unit")
        print_table(console, headings, published[1], f"{assumed.reference}: here (printed), by mount")
    print_table(console, COLUMNS, coefficient_rows(prediction), f"body frame: {prediction.body_frame}")
    for found in prediction.unobservable:
        say(console, f"not observable: {found.text}")
    say(console, f"results in {out}")
    answer(out / "prediction.json", as_json)


def _published(noise: NoiseSet | None) -> dict[str, dict[str, float]]:
    """Columns of the published table that a noise set reproduces; none without."""
    from sdimu_calibration.storage.files.reference_file import read_columns, read_reference

    if noise is None or not noise.reference:
        return {}
    return {column: read_reference(noise.reference, column) for column in read_columns(noise.reference)}


def _beside(
    what: tuple[Plan, Site, ImuSpecification, Model],
    noise: NoiseSet,
    printed: Mapping[str, Mapping[str, float]],
    prediction: Prediction,
) -> list[tuple[str, ...]]:
    """Rows of the published table beside our own numbers."""
    from sdimu_calibration.core.planning.predict import largest_by_effect
    from sdimu_calibration.core.planning.predict import predict as simulate
    from sdimu_calibration.report.prediction import display_units, published_rows

    found = {
        column: largest_by_effect(simulate(*what, mount_rad=_radians(column.removesuffix(" deg")), noise=noise))
        for column in printed
    }
    listed = set.intersection(*(set(values) for values in printed.values()))
    units = {effect: unit for effect, unit in display_units(prediction).items() if effect in listed}
    return published_rows(found, printed, units)


def _radians(text: str) -> Any:
    """Read ``"2"`` or ``"1,2,3"`` (deg) as a rotation vector (rad), shape (3,)."""
    import numpy as np

    try:
        values = [math.radians(float(part)) for part in text.split(",")]
    except ValueError:
        values = []
    if len(values) not in (1, 3) or not all(abs(value) <= math.tau for value in values):
        raise DataError(f"--mount '{text}': expected an angle in degrees up to 360, or three such as '1,2,3'")
    return np.array(values * 3 if len(values) == 1 else values)
