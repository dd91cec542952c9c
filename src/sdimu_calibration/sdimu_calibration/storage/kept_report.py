"""What a recording of a set said, kept as a file: the reduction, and what belongs to it, as plain arrays.

The first line is the format, the number of the job (`set_work.job_number`: recording, question and program) and a
digest of number and content. A file of another job, or of which a byte has changed, is not believed: its reduction is
made anew.
"""

from __future__ import annotations

import hashlib
import io
import json
import zipfile
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from pathlib import Path
from types import UnionType
from typing import Any, Union, get_args, get_origin, get_type_hints

import numpy as np
from numpy.typing import NDArray

from sdimu_calibration.core.joint.member import Report
from sdimu_calibration.core.note import Note, Topic
from sdimu_calibration.storage.files.whole_file import beside

REPORT_FORMAT = "sdimu-reduction/7"
"""What a recording says: a line, then an NPZ file of plain arrays; no code is loaded from it."""
SUFFIX = ".reduction"
LONGEST = 1 << 28
"""Bytes of a kept report at most: a recording of a day with all candidates has a fifth."""


def write_report(path: Path, report: Report, number: str) -> None:
    """Write a report of a job beside its place and rename it; the folder is made too.

    `number`: of the job that it answers.
    """
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    arrays: dict[str, NDArray[Any]] = {}
    words = json.dumps({"format": REPORT_FORMAT, "report": _plain(report, arrays)}).encode()
    content = io.BytesIO()
    np.savez(content, words=np.frombuffer(words, dtype=np.uint8), **arrays)  # type: ignore[arg-type]
    part = beside(path)
    try:
        part.write_bytes(_first_line(number, content.getvalue()) + content.getvalue())
        part.replace(path)
    finally:
        part.unlink(missing_ok=True)


def read_report(path: Path, number: str) -> Report | None:
    """Read the report of a job; None where there is none, or the file is damaged or of another: it is made again."""
    path = Path(path)
    try:
        if not path.is_file() or path.stat().st_size > LONGEST:
            return None
        whole = path.read_bytes()
        content = whole[whole.find(b"\n") + 1 :]
        if whole[: -len(content)] != _first_line(number, content):
            return None
        return _unpacked(content)
    except Exception:
        # Damage shows as errors of zipfile (a member that seems encrypted), of NumPy's headers and of the tokenizer.
        return None


def _first_line(number: str, content: bytes) -> bytes:
    """Format, number of the job, and a digest of all three."""
    digest = hashlib.sha256(f"{REPORT_FORMAT} {number}\n".encode() + content).hexdigest()
    return f"{REPORT_FORMAT} {number} {digest}\n".encode()


def _unpacked(content: bytes) -> Report | None:
    with zipfile.ZipFile(io.BytesIO(content)) as members:
        # Arrays are stored as they are: what unpacks to more is no report.
        if sum(member.file_size for member in members.infolist()) > len(content):
            return None
    with np.load(io.BytesIO(content), allow_pickle=False) as file:
        words = json.loads(file["words"].tobytes())
        return _report(words, {key: file[key] for key in file.files if key != "words"})


def _report(words: dict[str, Any], arrays: dict[str, Any]) -> Report | None:
    if words["format"] != REPORT_FORMAT:
        return None
    report: Report = _built(Report, words["report"], arrays)
    found = report.reduction
    if found.A.shape != (len(found.y), len(found.names) + len(found.labels)):
        return None
    return report


def _plain(value: Any, arrays: dict[str, NDArray[Any]]) -> Any:
    """Give a dataclass, and what is in it, as plain data; an array goes to `arrays`, its key is left in its place."""
    if isinstance(value, Note):
        return {"bare": value.bare, "topic": value.topic, "end": value.removeprefix(value.bare)}
    if is_dataclass(value):
        return {each.name: _plain(getattr(value, each.name), arrays) for each in fields(value)}
    if isinstance(value, np.ndarray):
        key = f"array_{len(arrays)}"
        arrays[key] = value
        return key
    if isinstance(value, Mapping):
        return {key: _plain(entry, arrays) for key, entry in value.items()}
    if isinstance(value, tuple | list):
        return [_plain(entry, arrays) for entry in value]
    return value


def _built(hint: Any, value: Any, arrays: Mapping[str, NDArray[Any]]) -> Any:
    """Build what `_plain` gave, of the type `hint`."""
    if isinstance(hint, UnionType) or get_origin(hint) is Union:
        return None if value is None else _built(get_args(hint)[0], value, arrays)
    if is_dataclass(hint):
        hints = get_type_hints(hint)
        return hint(**{name: _built(hints[name], entry, arrays) for name, entry in value.items()})  # type: ignore[operator]
    if hint is str and isinstance(value, dict):
        return Note(value["bare"], value["topic"] and Topic(value["topic"]), value["end"])
    if get_origin(hint) is np.ndarray:
        return arrays[value]
    if get_origin(hint) is tuple:
        kind, *others = get_args(hint)
        kinds = [kind] * len(value) if others == [...] else [kind, *others]
        return tuple(_built(each, entry, arrays) for each, entry in zip(kinds, value, strict=True))
    return value
