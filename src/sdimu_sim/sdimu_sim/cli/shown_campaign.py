"""What the verbs of studies share: a campaign with a bar of its own, and the check of the kinds that were asked for."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.console import Console

    from sdimu_sim.campaign.campaign import Work
    from sdimu_sim.campaign.shards import Row


def shown_campaign(
    console: Console, name: str, work: Work, seeds: Sequence[int], out: Path, workers: int
) -> list[Row]:  # fmt: skip
    """Run a campaign and show how far it is; parameters as for `run_campaign`, `name` goes before each word."""
    from sdimu_calibration.cli.progress import bar
    from sdimu_sim.campaign.campaign import HERE, run_campaign

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
