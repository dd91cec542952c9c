"""`sdimu calibrate`: a bag to coefficients."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

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

if TYPE_CHECKING:
    from rich.console import Console

    from sdimu_calibration.core.recording import Recording
    from sdimu_calibration.core.results import Calibration
    from sdimu_calibration.core.specification import ImuSpecification

ESTIMATORS = ("auto", "filter", "batch", "classical", "hand")
DIAGNOSED = ("auto", "filter", "hand")
"""Those whose residuals a diagnosis can read."""
HAND_CHOSEN = (
    "by hand: in rests as short as these the gyros' noise hides the Earth's rate, so nothing is navigated "
    "(--estimator filter to do it all the same)"
)


def calibrate(
    bag: Annotated[Path, typer.Argument(metavar="BAG", help="rosbag2 folder or .mcap file.")],
    model: Annotated[
        str | None, typer.Option(help="Model to estimate: name in config/model or path; baseline (by hand: hand).")
    ] = None,
    site: Annotated[
        str | None, typer.Option(help="Where the test was: name in config/site or path; daejeon (by hand: none).")
    ] = None,
    imu: Annotated[str, typer.Option(help="Specification of the IMU: name in config/imu or path.")] = "dtg",
    add: Annotated[
        list[str] | None,
        typer.Option(
            metavar="EFFECT",
            help="Effect to estimate besides: a name, one of its coefficients, or a YAML file; may be repeated.",
        ),
    ] = None,
    noise: Annotated[
        str | None, typer.Option(help="estimated: white noise from the rests of the recording, not from --imu.")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Folder of the results; BAG_calibration by default.")] = None,
    truth: Annotated[Path | None, typer.Option(help="Truth of a simulation, to show the errors.")] = None,
    estimator: Annotated[
        str, typer.Option(help="filter, batch (least squares), classical (table angles), hand; auto: filter or hand.")
    ] = "auto",
    hand: Annotated[bool, typer.Option("--hand", help="Moved by hand: the same as --estimator hand.")] = False,
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
    from rich.console import Console

    from sdimu_calibration.cli.progress import bar
    from sdimu_calibration.core.units import STANDARD_GRAVITY
    from sdimu_calibration.report.page import write_report
    from sdimu_calibration.report.table import rich_table, rows
    from sdimu_calibration.storage.config import load_imu
    from sdimu_calibration.storage.effect_file import extended_model
    from sdimu_calibration.storage.opening import open_test
    from sdimu_calibration.storage.reference_file import read_truth
    from sdimu_calibration.storage.result_file import write_result

    check_estimator(estimator)
    console = Console()
    specification = load_imu(imu)
    check_options(model, add, site)
    origin = source(
        imu_topic, status_topic, joint_topic, temperature_topic, accel_unit, gyro_unit, accel_sign, gyro_sign
    )
    asked = "hand" if hand else estimator
    handheld = None if asked == "auto" else asked == "hand"
    recording, specification, where = open_test(bag, site, specification, origin, handheld, measured(noise))
    chosen = chosen_estimator(asked, recording, specification)
    if truth is not None and chosen == "classical":
        raise typer.BadParameter(
            "the classical estimator answers in the table's axes, in which no truth is kept: leave it out, or see "
            "sdimu study mount", param_hint="--truth",
        )  # fmt: skip
    if chosen == "hand" and not (hand or estimator == "hand"):
        console.print(HAND_CHOSEN, soft_wrap=True)
    wanted = extended_model(model or ("hand" if chosen == "hand" else "baseline"), add or [])
    estimate = _estimators()[chosen]
    with explained(console, recording.notes), bar(console) as progress:
        result = estimate(recording, where, specification, wanted, progress=progress)
    # Without a place gravity is a convention, and the truth is compared at it.
    taken = STANDARD_GRAVITY if where is None else None
    true = None if truth is None else read_truth(truth, result.body_frame, taken)
    folder = out or default_folder(bag)
    write_result(folder / "result.json", result)
    write_report(folder / "report.html", result, title=f"Calibration of {bag.name}", truth=true)
    console.print(rich_table(rows(result, true), f"body frame: {result.body_frame}"), soft_wrap=True)
    tell(console, (*recording.notes, *(note for note in result.notes if note not in recording.notes)))
    console.print(f"results in {folder}", soft_wrap=True)


def tell(console: Console, notes: Iterable[str]) -> None:
    """Print notes, one line each."""
    for note in notes:
        console.print(f"note: {note}", soft_wrap=True, markup=False, highlight=False)


@contextmanager
def explained(console: Console, notes: Iterable[str]) -> Iterator[None]:
    """Print the notes of a recording when an estimate refuses it: they may say why."""
    from sdimu_calibration.core.recording import DataError

    try:
        yield
    except DataError:
        tell(console, notes)
        raise


def check_options(model: str | None, add: list[str] | None, site: str | None) -> None:
    """Refuse names that do not exist before a long recording is read.

    Raises
    ------
    DataError
    """
    from sdimu_calibration.storage.config import load_site
    from sdimu_calibration.storage.effect_file import extended_model

    extended_model(model or "baseline", add or [])
    if site is not None:
        load_site(site)


def measured(noise: str | None) -> bool:
    """Whether ``--noise`` asks for the white noise of the rests.

    Raises
    ------
    DataError
        When it is another word.
    """
    from sdimu_calibration.core.recording import DataError

    if noise not in {None, "estimated"}:
        raise DataError(f"--noise {noise}: expected 'estimated' (or leave it out: the noise of --imu)")
    return noise is not None


def check_estimator(name: str, known: tuple[str, ...] = ESTIMATORS) -> None:
    """Refuse an estimator that does not exist, before anything is read.

    Raises
    ------
    DataError
    """
    from sdimu_calibration.core.recording import DataError

    if name not in known:
        raise DataError(f"--estimator {name}: expected one of {', '.join(known)}")


def chosen_estimator(name: str, recording: Recording, imu: ImuSpecification) -> str:
    """Decide between filter and hand when it is left open, by what the gyros see of the Earth's rate."""
    from sdimu_calibration.core.data.static_detection import hides_earth_rate

    if name != "auto":
        return name
    return "hand" if hides_earth_rate(recording, imu) else "filter"


def _estimators() -> dict[str, Callable[..., Calibration]]:
    """All estimators by name."""
    from sdimu_calibration.core.batch.batch import batch_calibrate
    from sdimu_calibration.core.batch.classical import classical_calibrate
    from sdimu_calibration.core.calibrate import calibrate as filter_calibrate
    from sdimu_calibration.core.handheld.handheld import handheld_calibrate

    return {
        "filter": filter_calibrate, "batch": batch_calibrate, "classical": classical_calibrate,
        "hand": handheld_calibrate,
    }  # fmt: skip


def default_folder(bag: Path, what: str = "calibration") -> Path:
    """Folder of the results of a bag: beside it, its stem with ``_calibration``."""
    bag = bag.resolve()
    return bag.with_name(f"{bag.stem if bag.is_file() else bag.name}_{what}")
