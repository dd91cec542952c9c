"""`sdimu plan --after`: the plan that tells most beyond what recordings or results know."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from sdimu_calibration.cli.console import say
from sdimu_calibration.core.data_error import DataError

if TYPE_CHECKING:
    from rich.console import Console

    from sdimu_calibration.core.evidence.known import Standing
    from sdimu_calibration.core.plan import Plan
    from sdimu_calibration.core.plan_search import Bounds, Found


@dataclass(frozen=True)
class After:
    """What stands in the options of `sdimu plan`; entries as the options of the same names."""

    paths: Sequence[Path]
    imu: str | None
    site: str | None
    model: str


def standing_of(console: Console, asked: After) -> Standing:
    """Read what results know; recordings are diagnosed first, several as one set."""
    from sdimu_calibration.storage.files.standing_file import holds_standing, read_standing, standing_of_result

    results = [p for p in asked.paths if holds_standing(p) or (p / "result.json").is_file() or p.name == "result.json"]
    if results and len(asked.paths) > 1:
        raise DataError(
            f"--after {results[0]}: results stand alone, as two of them may count a recording twice; name the bags, "
            "which are then diagnosed together"
        )
    if results:
        return read_standing(results[0]) if holds_standing(results[0]) else standing_of_result(results[0], asked.imu)
    return _diagnosed(console, asked)


def _diagnosed(console: Console, asked: After) -> Standing:
    from sdimu_calibration.cli.options import FitRequest, StatedOpening
    from sdimu_calibration.cli.progress import bar
    from sdimu_calibration.cli.set_run import SetRequest, diagnosed_set
    from sdimu_calibration.core.diagnosis.diagnose import climb
    from sdimu_calibration.core.diagnosis.standing import standing
    from sdimu_calibration.core.diagnosis.summary import summarise
    from sdimu_calibration.core.estimation.solve import solve
    from sdimu_calibration.storage.files.config import load_imu
    from sdimu_calibration.storage.files.model_choice import named_model
    from sdimu_calibration.storage.files.verdict_words import headline
    from sdimu_calibration.storage.opening import open_test

    if len(asked.paths) > 1:
        request = SetRequest(asked.paths, StatedOpening(asked.site, asked.imu), FitRequest(asked.model))
        found = diagnosed_set(console, request, ())[0]
        say(console, f"{found.verdict}: {found.sentence}")
        return found.standing
    test = open_test(asked.paths[0], asked.site, None if asked.imu is None else load_imu(asked.imu))
    with bar(console) as progress:
        one = summarise(climb(solve(test, named_model(asked.model, ()), progress=progress), progress=progress))
    say(console, f"{one.diagnosis.verdict}: {headline(one)}")
    return standing(one.diagnosis, one.found)


def tell_gain(
    console: Console, start: Plan, found: Found, classes: Sequence[Sequence[str]], sigmas: tuple[Bounds, Bounds, Bounds]
) -> None:
    """Say what the plan tells beyond what is known, beside the plan that the search began with.

    Parameters
    ----------
    classes : sequence of sequence of str
        What is open, by coefficients.
    sigmas : tuple of Bounds
        Known, with the start, with the plan that was found.
    """
    from sdimu_calibration.core.effects.selection import resolve
    from sdimu_calibration.core.plan_search import gain
    from sdimu_calibration.core.plan_search.next_turn import apart, in_sigmas

    known, first, last = sigmas
    tells = [gain(known.covariance, b.covariance) for b in (first, last)]
    say(
        console,
        f"beyond what is known {start.name} tells {tells[0]:.1f} nat in {start.duration_s / 60.0:.1f} min, the plan "
        f"found {tells[1]:.1f} nat in {found.minutes:.1f} min ({found.tried} plans tried)",
    )
    for labels in classes:
        names = [p.name for label in labels for p in resolve(label).parameters]
        sizes = in_sigmas(*(apart(b, names, None) for b in sigmas))
        say(
            console,
            f"{labels[0]} from {', '.join(labels[1:])}, each as large as its prior: apart by {sizes[0]} sigma now, "
            f"{sizes[1]} after {start.name}, {sizes[2]} after the plan found",
        )
