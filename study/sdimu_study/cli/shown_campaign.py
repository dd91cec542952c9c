"""What the verbs of studies share: a campaign with a bar, checks of what was asked for, a page at the end."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rich.console import Console

    from sdimu_study.campaign import Work
    from sdimu_study.shards import Row


def shown_campaign(
    console: Console, name: str, work: Work, seeds: Sequence[int], out: Path, workers: int
) -> list[Row]:  # fmt: skip
    """Run a campaign and show how far it is; parameters as for `run_campaign`, `name` goes before each word."""
    from sdimu_calibration.cli.progress import bar
    from sdimu_study.campaign import HERE, run_campaign

    with bar(console) as progress:
        return run_campaign(
            work, seeds, out, HERE if workers == 1 else None, workers=workers,
            progress=lambda word, share: progress(f"{name}: {word}", share),
        )  # fmt: skip


def check_kinds(asked: Collection[str] | None, known: Collection[str]) -> None:
    """Refuse a kind of test that there is not.

    Raises
    ------
    DataError
        When one is unknown.
    """
    from sdimu_calibration.core.recording import DataError

    unknown = sorted(set(asked or ()) - set(known))
    if unknown:
        raise DataError(f"--kind {unknown[0]}: expected one of {', '.join(known)}")


def imu_files(asked: Sequence[str] | None, without: str = "") -> list[str]:
    """Name the IMU files of a study, each once: those that were asked for, or all of config/imu.

    Parameters
    ----------
    asked : sequence of str, optional
    without : str
        One that the study does not take, because its runs are by hand.

    Raises
    ------
    DataError
        When one is not in config/imu (worlds and folders of a study bear its name), or is `without`.
    """
    from sdimu_calibration.core.recording import DataError
    from sdimu_calibration.storage.files.config import config_folder

    known = sorted(path.stem for path in (config_folder() / "imu").glob("*.yaml") if path.stem != without)
    unknown = [name for name in asked or () if name not in known]
    if unknown:
        needs = "this study needs the file of an IMU on a rate table" if without else "this study needs a file"
        raise DataError(f"--imu {unknown[0]}: {needs} in {config_folder() / 'imu'}: one of {', '.join(known)}")
    return list(dict.fromkeys(asked or known))


def leave_page(console: Console, place: Path, rows: Any, text: str) -> None:
    """Write what a study found as data and as a page, and show the page.

    Parameters
    ----------
    console : Console
    place : Path
        Of both files, without their endings.
    rows : dict or list
        As JSON takes it.
    text : str
        Markdown.
    """
    from sdimu_calibration.storage.files.json_file import write_json

    write_json(place.with_suffix(".json"), rows)
    place.with_suffix(".md").write_text(text, encoding="utf-8")
    console.print(text, soft_wrap=True, markup=False, highlight=False)
    console.print(f"results in {place.parent}", soft_wrap=True)
