"""The two ways of `sdimu diagnose`, by navigation and by hand: find, tell, leave the same three files."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.console import Console

    from sdimu_calibration.core.diagnosis.grow import Rung
    from sdimu_calibration.core.effects.effect import Effect
    from sdimu_calibration.core.recording import Recording
    from sdimu_calibration.core.specification import ImuSpecification, Model, Site


@dataclass(frozen=True)
class Asked:
    """What is to be diagnosed, and where the files go.

    Attributes
    ----------
    recording : Recording
    site : Site or None
        None by hand, where nobody needs to say.
    imu, model : ImuSpecification, Model
    extra : sequence of Effect
        The user's own, tried with the catalogue.
    folder : Path
    title : str
        Of the report.
    """

    recording: Recording
    site: Site | None
    imu: ImuSpecification
    model: Model
    extra: Sequence[Effect]
    folder: Path
    title: str


def diagnose_navigated(console: Console, asked: Asked, grow: bool, draws: int) -> None:
    """Diagnose by navigation; with `grow` by real refits, with `draws` of pure noise besides."""
    from sdimu_calibration.cli.calibrate import explained, tell
    from sdimu_calibration.cli.diagnosis_text import print_account, print_ladder
    from sdimu_calibration.cli.progress import bar
    from sdimu_calibration.core.diagnosis.bootstrap import bootstrap
    from sdimu_calibration.core.diagnosis.diagnose import diagnose
    from sdimu_calibration.core.diagnosis.grow import grow as climb
    from sdimu_calibration.report.page import write_report
    from sdimu_calibration.report.report_extras import report_extras
    from sdimu_calibration.storage.diagnosis_file import account, write_diagnosis
    from sdimu_calibration.storage.result_file import write_result

    assert asked.site is not None
    data = (asked.recording, asked.site, asked.imu, asked.model)
    with explained(console, asked.recording.notes), bar(console) as progress:
        found = diagnose(*data, asked.extra, progress=progress)
    told = account(found)
    print_account(console, told)
    rungs: tuple[Rung, ...] = ()
    if grow:
        with bar(console) as progress:
            rungs = climb(*data, asked.extra, progress=progress, first=found).rungs
        print_ladder(console, rungs)
    null = None
    if draws:
        with bar(console) as progress:
            null = bootstrap(found, draws, progress=progress)
        console.print(f"bootstrap: {null.sentence}", soft_wrap=True, markup=False, highlight=False)
    write_diagnosis(asked.folder / "diagnosis.json", told, rungs, null)
    write_result(asked.folder / "result.json", found.after if told.candidates else found.before)
    with bar(console) as progress:
        progress("navigation without aid", 0.5)
        more = report_extras(asked.recording, found, *data[1:], rungs)
    write_report(asked.folder / "report.html", found.after, title=asked.title, diagnosis=found, more=more)
    tell(console, asked.recording.notes)


def diagnose_handheld_run(console: Console, asked: Asked) -> None:
    """Diagnose a hand-held run by its least squares."""
    from sdimu_calibration.cli.calibrate import explained, tell
    from sdimu_calibration.cli.handheld_text import print_handheld_summary
    from sdimu_calibration.cli.progress import bar
    from sdimu_calibration.core.diagnosis.handheld_diagnosis import diagnose_handheld
    from sdimu_calibration.core.diagnosis.handheld_summary import summarise_handheld
    from sdimu_calibration.report.page import write_report
    from sdimu_calibration.storage.handheld_diagnosis_file import write_handheld_diagnosis
    from sdimu_calibration.storage.result_file import write_result

    known = asked.recording.notes
    with explained(console, known), bar(console) as progress:
        found = diagnose_handheld(
            asked.recording, asked.site, asked.imu, asked.model, asked.extra, progress=progress
        )  # fmt: skip
    told = summarise_handheld(found)
    print_handheld_summary(console, told)
    write_handheld_diagnosis(asked.folder / "diagnosis.json", told)
    write_result(asked.folder / "result.json", found.after)
    write_report(asked.folder / "report.html", found.after, title=asked.title, by_hand=told)
    tell(console, (*known, *(note for note in found.after.notes if note not in known)))
