"""What the verbs of studies share: a campaign with a bar, checks of what was asked for, a page at the end."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sdimu_calibration.cli.console import plain

if TYPE_CHECKING:
    from rich.console import Console

    from sdimu_study.study import Key, Row, Study, Table


def shown_campaign(
    console: Console, name: str, work: Callable[[int], Row], seeds: Sequence[int], out: Path, workers: int
) -> list[Row]:
    """Run a campaign and show how far it is; parameters as for `run_campaign`, `name` goes before each word."""
    from sdimu_calibration.cli.progress import bar
    from sdimu_study.campaign import HERE, run_campaign

    with bar(console) as progress:
        return run_campaign(
            work,
            seeds,
            out,
            HERE if workers == 1 else None,
            workers=workers,
            progress=lambda word, share: progress(f"{name}: {word}", share),
        )


def conduct(
    study: Study[Any, Any, Any], cases: Mapping[Any, Any], seeds: Sequence[int], out: Path, workers: int
) -> dict[Key, list[Row]]:
    """Run every case of a study; runs are kept in folders below `out` that bear the words of the case's key."""
    console = plain()
    return {
        key: shown_campaign(
            console, ", ".join(key), study.of(case), seeds, out.joinpath(*(w.replace(" ", "_") for w in key)), workers
        )
        for key, case in cases.items()
    }


def conduct_as_table(
    study: Study[Any, Any, Any], cases: Mapping[Any, Any], seeds: Sequence[int], out: Path, workers: int
) -> None:
    """Run every case of a study, and leave its rows and one table with a last line of all."""
    results = conduct(study, cases, seeds, out, workers)
    leave(out / study.name, results, study.table(results, ("all",)))


def check_kinds(asked: Collection[str] | None, known: Collection[str]) -> None:
    """Refuse a kind of test that there is not."""
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
    """
    from sdimu_calibration.core.recording import DataError
    from sdimu_calibration.storage.files.config import config_folder

    known = sorted(path.stem for path in (config_folder() / "imu").glob("*.yaml") if path.stem != without)
    unknown = [name for name in asked or () if name not in known]
    if unknown:
        needs = "this study needs the file of an IMU on a rate table" if without else "this study needs a file"
        raise DataError(f"--imu {unknown[0]}: {needs} in {config_folder() / 'imu'}: one of {', '.join(known)}")
    return list(dict.fromkeys(asked or known))


def leave(place: Path, results: Any, *shown: str | Table) -> None:
    """Write what a study found: rows as JSON, text as a page, tables on the terminal alone.

    Parameters
    ----------
    place : Path
        Of both files, without their endings.
    results : dict
        Rows by key, or as JSON takes them.
    shown : str or Table
        Markdown; what is printed.
    """
    from sdimu_calibration.storage.files.json_file import write_json

    console = plain()
    write_json(place.with_suffix(".json"), {" ".join(k) if isinstance(k, tuple) else k: v for k, v in results.items()})
    for one in shown:
        if isinstance(one, str):
            place.with_suffix(".md").write_text(one, encoding="utf-8")
            console.print(one, soft_wrap=True, markup=False, highlight=False)
        else:
            console.print(one.terminal())
    console.print(f"results in {place.parent}", soft_wrap=True)
