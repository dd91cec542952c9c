"""What a result was made from and how: the files of its recordings with their hashes, the command, the program."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from sdimu_calibration.shell_words import joined
from sdimu_calibration.storage.bags.bag_metadata import custom_data
from sdimu_calibration.storage.files.file_hashes import file_hashes


@dataclass(frozen=True)
class Trace:
    """How a result came about."""

    made: str
    """When (UTC)."""
    program: str
    """Name and version."""
    command: str = ""
    """What was typed; empty from Python."""
    stated: tuple[tuple[str, str], ...] = ()
    """What the user named: IMU file, site, model, plan."""
    files: tuple[tuple[str, str], ...] = ()
    """Path of each file of the recordings and its SHA-256."""


def traced(bags: Sequence[Path] = (), arguments: Sequence[str] = (), **stated: str | Path | None) -> Trace:
    """Put down what is known now.

    `bags`: recordings, whose files are read once more for their hashes. `arguments`: of the command line, without the
    name of the program; empty from Python. `stated`: what the user named, by what it is; None for what was left out.
    """
    files = [(str(path), digest) for bag in bags for path, (_, digest) in file_hashes(bag).items()]
    plan = next((said for bag in bags if (said := custom_data(bag).get("plan"))), None)
    named = {**stated, "plan": plan} if plan else stated
    return Trace(
        datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
        f"sdimu {program_version()}",
        joined(["sdimu", *arguments]) if arguments else "",
        tuple((key, str(value)) for key, value in named.items() if value),
        tuple(files),
    )


def program_version() -> str:
    """Version of the program; empty where it runs without being installed."""
    try:
        return version("sdimu-calibration")
    except PackageNotFoundError:
        return ""
