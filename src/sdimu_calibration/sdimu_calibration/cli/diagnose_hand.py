"""`sdimu diagnose` on a hand-held run: fits in place of navigation, the same files left behind."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.console import Console

    from sdimu_calibration.core.effects.effect import Effect
    from sdimu_calibration.core.recording import Recording
    from sdimu_calibration.core.specification import ImuSpecification, Model, Site


def diagnose_hand(
    console: Console, recording: Recording, site: Site | None, imu: ImuSpecification, model: Model,
    extra: Sequence[Effect], folder: Path, title: str, told_noise: Sequence[str],
) -> None:  # fmt: skip
    """Find what the model is missing, tell it, leave diagnosis.json, result.json and report.html."""
    from sdimu_calibration.cli.calibrate import explained, tell
    from sdimu_calibration.cli.hand_text import print_hand_account
    from sdimu_calibration.cli.progress import bar
    from sdimu_calibration.core.diagnosis.by_hand import diagnose_by_hand
    from sdimu_calibration.core.diagnosis.hand_account import account_by_hand
    from sdimu_calibration.report.page import write_report
    from sdimu_calibration.storage.hand_diagnosis_file import write_hand_diagnosis
    from sdimu_calibration.storage.result_file import write_result

    with explained(console, recording.notes), bar(console) as progress:
        found = diagnose_by_hand(recording, site, imu, model, extra, progress=progress)
    told = account_by_hand(found)
    print_hand_account(console, told)
    write_hand_diagnosis(folder / "diagnosis.json", told)
    write_result(folder / "result.json", found.after)
    write_report(folder / "report.html", found.after, title=title, by_hand=told)
    notes = (*found.after.notes, *told_noise)
    tell(console, (*recording.notes, *(note for note in notes if note not in recording.notes)))
    console.print(f"results in {folder}", soft_wrap=True)
