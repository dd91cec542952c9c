"""Finished runs of a campaign as small files, so that a campaign that was stopped goes on where it stood.

A folder belongs to one set of settings *and* one state of the program: runs of two programs in one mean would
be a mean of nothing.
"""

from __future__ import annotations

import hashlib
import inspect
import json
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import asdict, is_dataclass
from functools import cache
from pathlib import Path
from types import CodeType, FunctionType
from typing import Any

import rate_table_sim
import sdimu_calibration
import sdimu_sim
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.storage.files.json_file import read_json, write_json
from sdimu_study.study import Row, Runs

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
    text = json.dumps({"work": name, "settings": fields}, default=_named, sort_keys=True)
    plain: dict[str, Any] = json.loads(text)
    return plain


def _named(value: object) -> str:
    """Name a function, whose repr would hold an address; anything else by its repr."""
    return f"{value.__module__}.{value.__qualname__}" if isinstance(value, FunctionType) else repr(value)


def sources_of(work: Callable[..., Any]) -> list[str]:
    """List the sources of a piece of work and of all of its own package that it uses; its page is not among them.

    Functions and classes as text, constants by their repr; those of the three cores are in `program_digest`.
    """
    waiting: list[Any] = [work.world, work.run, work.score] if isinstance(work, Runs) else [_defined(work)]
    own = {one.__module__.partition(".")[0] for one in waiting}
    found: dict[str, str] = {}
    while waiting:
        one = waiting.pop()
        name = f"{one.__module__}.{one.__qualname__}"
        if name in found:
            continue
        found[name] = inspect.getsource(one)
        for word, used in _used(one):
            value = getattr(used, "__wrapped__", used)
            if isinstance(value, FunctionType | type):
                if value.__module__.partition(".")[0] in own:
                    waiting.append(value)
            elif not inspect.ismodule(value) and not callable(value):
                listed = sorted(map(repr, value)) if isinstance(value, set | frozenset) else value
                found[f"{one.__module__}:{word}"] = repr(listed)
    return [f"{name}\n{text}" for name, text in sorted(found.items())]


def _defined(work: Callable[..., Any]) -> Any:
    return work if isinstance(work, FunctionType | type) else type(work)


def _used(one: Any) -> Iterator[tuple[str, Any]]:
    """Names that a function, or the methods of a class, take from the module around, with their values."""
    if isinstance(one, type):
        methods = [getattr(value, "fget", value) for value in vars(one).values()]
        functions = [m for m in methods if isinstance(m, FunctionType) and m.__module__ == one.__module__]
        yield from ((base.__qualname__, base) for base in one.__bases__)
    else:
        functions = [inspect.unwrap(one)]
    for function in functions:
        around = function.__globals__
        yield from ((name, around[name]) for name in sorted(_names(function.__code__)) if name in around)


def _names(code: CodeType) -> set[str]:
    inner = (part for part in code.co_consts if isinstance(part, CodeType))
    return set(code.co_names).union(*map(_names, inner))


def key_of(work: Callable[..., Any]) -> str:
    """Digest of the settings of a piece of work, of the sources that it is made of, and of the program."""
    text = json.dumps(settings_of(work), sort_keys=True) + "\n".join(sources_of(work)) + program_digest()
    return hashlib.sha256(text.encode()).hexdigest()[:16]


class Shards:
    """The shards of one campaign.

    Parameters
    ----------
    out : Path
        Folder of the campaigns; this one has a folder of its own inside, named by its key.
    work : callable
        What is run for every seed; its settings are the key.
    """

    def __init__(self, out: Path, work: Callable[..., Any]) -> None:
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
        """All kept runs by seed; a run that failed once and was done later counts as done."""
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
