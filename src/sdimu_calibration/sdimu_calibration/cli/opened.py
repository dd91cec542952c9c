"""A recording opened for a verb, with what it is fitted by; and what a verb says at its end."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from sdimu_calibration.cli.console import say
from sdimu_calibration.core.data_error import DataError
from sdimu_calibration.core.note import without_advice

if TYPE_CHECKING:
    from rich.console import Console

    from sdimu_calibration.cli.options import Fitted, StatedOpening
    from sdimu_calibration.core.estimation.prepared_test import PreparedTest
    from sdimu_calibration.core.results import Calibration
    from sdimu_calibration.core.specification import Model
    from sdimu_calibration.core.verdict import Verdict

NOT_TRUSTED = 3
"""Exit status of a run that is done, and whose estimate is not to be trusted."""
HANDHELD_CHOSEN = "handheld: {why}, so nothing is navigated (--estimator filter forces navigation)"


def opened(console: Console, bag: Path, opening: StatedOpening, request: Fitted) -> tuple[PreparedTest, Model, str]:
    """Open the test of a bag, read its model and check its estimator.

    Returns
    -------
    test : PreparedTest
    model : Model
    estimator : str
        As it was asked for, ``auto`` included.
    """
    from sdimu_calibration.core.estimation.solve import AUTO
    from sdimu_calibration.storage.files.effect_file import find_effects
    from sdimu_calibration.storage.files.model_choice import by_hand, named_model

    wanted, added = request.asked_estimator, request.add or []
    # A wrong name is reported before a long recording is read; which model it is added to, the recording may decide.
    stated = opening.read(request.handheld)
    named_model(request.model, [])
    for text in added:
        find_effects(text)
    test = stated.test(bag)
    handheld = by_hand(test, wanted)
    if handheld and wanted == AUTO:
        console.print(HANDHELD_CHOSEN.format(why=test.why_handheld), soft_wrap=True)
    for option, value in (("--whole-turns", stated.whole_turns), ("--rests", stated.rests)):
        if value and not handheld:
            raise DataError(
                f"{option}: only a run by hand takes it, and this one is navigated: leave it out, or state --hand"
            )
    return test, named_model(request.model, added, handheld=handheld), wanted


def tell(console: Console, notes: Iterable[str]) -> None:
    """Print notes, one line each."""
    for note in notes:
        say(console, f"note: {note}")


def leave(result: Calibration, diagnosed: tuple[Verdict, str] | None = None, to_diagnose: str = "") -> None:
    """Say on stderr which coefficients are one, and end with exit status 3 when a result is not to be trusted.

    `diagnosed` is the verdict of a diagnosis and its sentence. Where there is one, it judges what does not fit;
    without, a misfit is enough. `to_diagnose` is the whole command that stands once in the place of all advice to
    diagnose.
    """
    for line in result.inseparable:
        typer.echo(f"sdimu: {line}", err=True)
    reasons = _reasons(result, diagnosed)
    told = without_advice(reasons) if to_diagnose else tuple(reasons)
    warn(told)
    if told != tuple(reasons):
        typer.echo(f"sdimu: to learn what the model misses: {to_diagnose}", err=True)
    if reasons:
        raise typer.Exit(NOT_TRUSTED)


def warn(reasons: Iterable[str]) -> None:
    """Say on stderr why a result is not to be trusted, one line each."""
    for line in reasons:
        typer.echo(f"sdimu: not to be trusted: {line}", err=True)


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
    try:
        yield
    except DataError:
        tell(console, notes)
        raise


def printing(console: Console, asked: bool) -> Callable[[Path], None]:
    """Return what prints a page as PDF where it is asked for; a browser that lacks is told before the work begins."""
    if not asked:
        return lambda _: None
    from sdimu_calibration.report.pdf import browser, print_pdf

    program = browser()
    return lambda page: say(console, f"printed: {print_pdf(page, program)}")


def folder_for_result(folder: Path) -> Path:
    """Return the folder of a calibration; one that holds a diagnosis is refused, as half of it would be replaced."""
    if (folder / "diagnosis.json").exists():
        raise DataError(
            f"{folder} holds a diagnosis, whose result.json and report.html would be replaced: choose another --out, "
            "or remove that folder"
        )
    return folder


def default_folder(bag: Path, what: str = "calibration") -> Path:
    """Folder of the results of a bag: beside it, its stem with ``_calibration``."""
    bag = bag.resolve()
    return bag.with_name(f"{bag.stem if bag.is_file() else bag.name}_{what}")
