"""Options that several verbs have, checked before a long recording is read, and where results go."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from sdimu_calibration.cli.console import say

if TYPE_CHECKING:
    from rich.console import Console

    from sdimu_calibration.core.estimation.prepared_test import PreparedTest
    from sdimu_calibration.core.results import Calibration
    from sdimu_calibration.core.specification import Model
    from sdimu_calibration.core.verdict import Verdict
    from sdimu_calibration.storage.opening import Source

ImuOption = Annotated[
    str | None, typer.Option(help="Specification of the IMU: name in config/imu or path; proposed when left out.")
]
SiteOption = Annotated[
    str | None, typer.Option(help="Where the test was: name in config/site or path; daejeon (handheld: none).")
]
ModelOption = Annotated[
    str | None, typer.Option(help="Model to estimate: name in config/model or path; baseline (handheld: hand).")
]
NoiseOption = Annotated[
    str | None, typer.Option(help="estimated: white noise from the rests of the recording, not from --imu.")
]
EstimatorOption = Annotated[
    str, typer.Option(help="filter, second-order, handheld, batch, classical; auto chooses one of the first three.")
]
WholeTurnsOption = Annotated[
    str | None,
    typer.Option(
        metavar="ANGLE", help="By hand: turns of about 360 deg about the vertical are whole to this, such as 1 deg."
    ),
]
SerialOption = Annotated[
    str | None, typer.Option(metavar="NUMBER", help="Serial number of the unit; taken from the bag where it says it.")
]
PowerOnOption = Annotated[
    str | None, typer.Option(metavar="NAME", help="Which switch-on of the unit; taken from the bag where it says it.")
]
HandOption = Annotated[bool, typer.Option("--hand", help="Moved by hand: the same as --estimator handheld.")]
DomainOption = Annotated[
    int | None,
    typer.Option(metavar="N", help="ROS domain of the nodes; that of ROS_DOMAIN_ID, or a free one, when left out."),
]
NOT_TRUSTED = 3
"""Exit status of a run that is done, and whose estimate is not to be trusted."""
HANDHELD_CHOSEN = "handheld: {why}, so nothing is navigated (--estimator filter forces navigation)"


def opened(
    console: Console, bag: Path, model: str | None, site: str | None, imu: str | None, add: list[str] | None,
    source: Source, estimator: str, noise: str | None, whole_turns: str | None = None,
) -> tuple[PreparedTest, Model, str]:  # fmt: skip
    """Open the test of a bag, read its model and check its estimator.

    Returns
    -------
    test : PreparedTest
    model : Model
    estimator : str
        As it was asked for, ``auto`` included.

    Raises
    ------
    DataError
        When an option names nothing, or the bag cannot be used.
    """
    from sdimu_calibration.core.estimation.solve import AUTO
    from sdimu_calibration.core.recording import DataError
    from sdimu_calibration.core.units import parse_quantity
    from sdimu_calibration.storage.files.config import load_imu, load_site
    from sdimu_calibration.storage.files.effect_file import find_effects
    from sdimu_calibration.storage.files.model_choice import HANDHELD, named_estimator, named_model
    from sdimu_calibration.storage.opening import open_test, with_imu_file

    wanted = named_estimator(estimator, "--estimator")
    if noise not in {None, "estimated"}:
        raise DataError(f"--noise {noise}: expected 'estimated' (or leave it out: the noise of --imu)")
    whole = 0.0 if whole_turns is None else parse_quantity(whole_turns, "deg")
    if whole < 0.0 or (whole_turns is not None and whole == 0.0):
        raise DataError(f"--whole-turns {whole_turns}: expected an angle above zero")
    # A wrong name is reported before a long recording is read; which model it is added to, the recording may decide.
    specification = None if imu is None else load_imu(imu)
    named_model(model, [])
    for text in add or []:
        find_effects(text)
    if site is not None:
        load_site(site)
    handheld = None if wanted == AUTO else wanted == HANDHELD
    test = with_imu_file(open_test(bag, site, specification, source, handheld, noise is not None), imu)
    if wanted == HANDHELD or (wanted == AUTO and test.why_handheld):
        if wanted == AUTO:
            console.print(HANDHELD_CHOSEN.format(why=test.why_handheld), soft_wrap=True)
        return replace(test, whole_turns=whole), named_model(model, add or [], handheld=True), wanted
    if whole:
        raise DataError("--whole-turns is of runs by hand, and this one is navigated: leave it out, or state --hand")
    return test, named_model(model, add or []), wanted


def tell(console: Console, notes: Iterable[str]) -> None:
    """Print notes, one line each."""
    for note in notes:
        say(console, f"note: {note}")


def leave(result: Calibration, diagnosed: tuple[Verdict, str] | None = None) -> None:
    """Say on stderr which coefficients are one, and end with exit status 3 when a result is not to be trusted.

    `diagnosed` is the verdict of a diagnosis and its sentence. Where there is one, it judges what does not fit;
    without, a misfit is enough.
    """
    for line in result.inseparable:
        typer.echo(f"sdimu: {line}", err=True)
    reasons = _reasons(result, diagnosed)
    for line in reasons:
        typer.echo(f"sdimu: not to be trusted: {line}", err=True)
    if reasons:
        raise typer.Exit(NOT_TRUSTED)


def _reasons(result: Calibration, diagnosed: tuple[Verdict, str] | None) -> list[str]:
    """List why a result is not to be trusted, one line each, each said once."""
    from sdimu_calibration.core.results import UNTRUSTED_VERDICTS

    grave = result.not_to_be_trusted
    if diagnosed is None:
        return list(dict.fromkeys([*grave, *result.misfits]))
    verdict, sentence = diagnosed
    if verdict not in UNTRUSTED_VERDICTS:
        return list(grave)
    return [f"{verdict}: {sentence}", *(line for line in grave if line not in sentence)]


@contextmanager
def explained(console: Console, notes: Iterable[str]) -> Iterator[None]:
    """Print the notes of a recording when an estimate refuses it: they may say why."""
    from sdimu_calibration.core.recording import DataError

    try:
        yield
    except DataError:
        tell(console, notes)
        raise


def default_folder(bag: Path, what: str = "calibration") -> Path:
    """Folder of the results of a bag: beside it, its stem with ``_calibration``."""
    bag = bag.resolve()
    return bag.with_name(f"{bag.stem if bag.is_file() else bag.name}_{what}")
