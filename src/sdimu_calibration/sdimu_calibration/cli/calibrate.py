"""`sdimu calibrate`: a bag to coefficients."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from sdimu_calibration.cli.console import answer, command, plain, say
from sdimu_calibration.cli.next_commands import NOT_LOOKED_FOR, TO_LEARN, Asked, spelled
from sdimu_calibration.cli.opened import default_folder, explained, folder_for_result, leave, opened, printing, tell
from sdimu_calibration.cli.option_groups import with_options
from sdimu_calibration.cli.options import BagsArgument, FitRequest, StatedOpening
from sdimu_calibration.cli.progress import bar
from sdimu_calibration.cli.set_run import SetRequest, calibrate_together, refuse_for_sets, the_only
from sdimu_calibration.core.note import MISFITS, topic_of
from sdimu_calibration.core.units import STANDARD_GRAVITY
from sdimu_calibration.storage.files.whole_file import written_together

if TYPE_CHECKING:
    from sdimu_calibration.core.results import Calibration

_SAME_DEGC = 0.5
"""Difference of two temperatures (deg C) up to which no coefficient differs by what counts: thermometers scatter so."""


@dataclass(frozen=True)
class CalibrationRequest(FitRequest):
    """What `sdimu calibrate` is asked."""

    truth: Annotated[Path | None, typer.Option(help="Truth of a simulation, to show the errors.")] = None


@with_options
def calibrate(bags: BagsArgument = None, *, request: CalibrationRequest, opening: StatedOpening) -> None:
    """Estimate the coefficients from a recording; leaves result.json and report.html.

    Exit status 3: done, but the estimate is not to be trusted; stderr says why.
    """
    from sdimu_calibration.core.estimation.outcome import outcome
    from sdimu_calibration.core.estimation.solve import solve
    from sdimu_calibration.core.site_reference import relative_line
    from sdimu_calibration.report.page import write_report
    from sdimu_calibration.report.table import rich_table, rows
    from sdimu_calibration.storage.files.reference_file import read_temperature, read_truth
    from sdimu_calibration.storage.files.result_file import write_result
    from sdimu_calibration.storage.trace import traced

    console, truth = plain(stderr=request.as_json), request.truth
    printed = printing(console, request.pdf)
    one = the_only(bags, opening, request)
    if isinstance(one, SetRequest):
        refuse_for_sets(opening, truth=truth)
        calibrate_together(one)
        return
    bag, opening, request = one
    folder = folder_for_result(request.out or default_folder(bag))
    test, wanted, chosen = opened(console, bag, opening, request)
    notes = test.recording.notes
    with explained(console, notes), bar(console) as progress:
        fit = solve(test, wanted, chosen, progress=progress)
        result = outcome(fit)
        progress("done", 1.0)
    # Without a place gravity is a convention, and the truth is compared at it.
    taken = STANDARD_GRAVITY if test.site is None else None
    true = None if truth is None else read_truth(truth, result.body_frame, taken)
    about = Asked.of((bag,), folder, opening, request)
    if truth is not None:
        notes = (*notes, *_other_temperature(truth, read_temperature(truth), result))
    with written_together(folder) as part:
        write_result(part / "result.json", result)
        trace = traced([bag], sys.argv[1:], site=opening.site, imu=opening.imu, model=request.model)
        write_report(
            part / "report.html",
            result,
            title=f"Calibration of {bag.name}",
            truth=true,
            fit=fit,
            trace=trace,
            spell=partial(spelled, asked=about),
        )
    printed(folder / "report.html")
    console.print(rich_table(rows(result, true), f"body frame: {result.body_frame}"), soft_wrap=True)
    at = relative_line(result.references)
    tell(console, (*((at,) if at else ()), *notes, *(note for note in result.notes if note not in notes)))
    misfit = any(topic_of(note) in MISFITS for note in result.notes)
    say(console, TO_LEARN if misfit else NOT_LOOKED_FOR)
    command(console, about.command("diagnose"))
    say(console, f"results in {folder}")
    answer(folder / "result.json", request.as_json)
    leave(result)


def _other_temperature(path: Path, true_degc: float | None, result: Calibration) -> list[str]:
    """Say that a truth counts from another temperature than the coefficients of a result, which hang on it."""
    from sdimu_calibration.core.results import START_TEMPERATURE

    from_degc = result.data.get(START_TEMPERATURE)
    hangs = any("temperature" in name for name in result.names)
    if true_degc is None or from_degc is None or not hangs or abs(true_degc - from_degc) < _SAME_DEGC:
        return []
    return [
        f"{path} is the truth at {true_degc:g} degC, and the coefficients are those at {from_degc:g} degC: they differ "
        f"by the temperature; to compare them: --reference-temperature '{true_degc:g} degC'"
    ]
