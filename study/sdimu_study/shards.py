"""Finished runs of a campaign as small files, so that a campaign that was stopped goes on where it stood.

A folder belongs to one set of settings *and* one state of the program: runs of two programs in one mean would
be a mean of nothing.
"""

from __future__ import annotations

import hashlib
import inspect
import json
from collections.abc import Iterable, Mapping
from dataclasses import asdict, is_dataclass
from functools import cache
from pathlib import Path
from typing import Any

import rate_table_sim
import sdimu_calibration
import sdimu_sim
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.storage.files.json_file import read_json, write_json

Row = dict[str, Any]

FORMAT = "sdimu-campaign/1"


@cache
def program_digest() -> str:
    """Digest of the sources that make a run's numbers: the three cores."""
    digest = hashlib.sha256()
    for package in (rate_table_sim, sdimu_calibration, sdimu_sim):
        core = Path(str(package.__file__)).parent / "core"
        for file in sorted(core.rglob("*.py")):
            digest.update(file.relative_to(core).as_posix().encode())
            digest.update(file.read_bytes())
    return digest.hexdigest()


def settings_of(work: object) -> dict[str, Any]:
    """Say in JSON what a piece of work is: its name and, for a dataclass, its fields."""
    kind = type(work) if is_dataclass(work) else work
    name = f"{getattr(kind, '__module__', '')}.{getattr(kind, '__qualname__', repr(kind))}"
    fields = asdict(work) if is_dataclass(work) and not isinstance(work, type) else {}
    plain: dict[str, Any] = json.loads(json.dumps({"work": name, "settings": fields}, default=repr, sort_keys=True))
    return plain


def key_of(work: object) -> str:
    """Digest of the settings of a piece of work, of the file it is written in, and of the program."""
    file = inspect.getsourcefile(type(work) if is_dataclass(work) else work)  # type: ignore[arg-type]
    own = Path(file).read_text(encoding="utf-8") if file else ""
    text = json.dumps(settings_of(work), sort_keys=True) + own + program_digest()
    return hashlib.sha256(text.encode()).hexdigest()[:16]


class Shards:
    """The shards of one campaign.

    Parameters
    ----------
    out : Path
        Folder of the campaigns; this one has a folder of its own inside, named by its key.
    work : object
        What is run for every seed; its settings are the key.
    """

    def __init__(self, out: Path, work: object) -> None:
        self.key = key_of(work)
        self.folder = Path(out) / f"runs-{self.key}"
        settings = {"format": FORMAT, "key": self.key, **settings_of(work)}
        write_json(self.folder / "campaign.json", settings)

    def write(self, rows: Iterable[Row]) -> Path:
        """Keep finished runs, failed ones too; a shard is named by its first and last seed."""
        kept = list(rows)
        path = self.folder / f"seeds-{kept[0]['seed']:07d}-{kept[-1]['seed']:07d}.json"
        write_json(path, {"format": FORMAT, "key": self.key, "runs": kept})
        return path

    def read(self) -> dict[int, Row]:
        """All kept runs by seed; a run that failed once and was done later counts as done.

        Raises
        ------
        DataError
            When a shard is not one, or belongs to other settings.
        """
        found: dict[int, Row] = {}
        for path in sorted(self.folder.glob("seeds-*.json")):
            content = read_json(path, FORMAT)
            if content.get("key") != self.key or not isinstance(content.get("runs"), list):
                raise DataError(f"{path}: a shard of another campaign; delete it")
            for row in content["runs"]:
                if row["seed"] not in found or "error" in found[row["seed"]]:
                    found[row["seed"]] = row
        return found


def failed(rows: Iterable[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    """Pick the runs that ended with an error."""
    return [row for row in rows if "error" in row]
