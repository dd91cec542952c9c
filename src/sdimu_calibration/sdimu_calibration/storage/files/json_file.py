"""Strict JSON files: no NaN, and whole or not there at all."""

from __future__ import annotations

import json
import math
from operator import attrgetter
from pathlib import Path
from typing import Any

import numpy as np

from sdimu_calibration.core.recording import DataError
from sdimu_calibration.storage.files.bounded_file import read_text
from sdimu_calibration.storage.files.whole_file import write_whole

LONGEST_JSON = 1 << 28
"""Bytes of a result at most: that of many recordings comes to some ten megabytes."""


def write_json(path: Path, content: Any) -> None:
    """Write `content`, whole or not at all; numbers that are not finite become ``null``; the folder is made.

    A list of numbers or words stands on one line, everything else one entry a line.
    """
    write_whole(path, json_text(content) + "\n")


def json_text(content: Any) -> str:
    """Write `content` as `write_json` does, as text."""
    return _text(content, "\n")


def entry(value: Any, keys: str, **more: Any) -> dict[str, Any]:
    """Give an object as an entry of a file.

    `keys`: its keys in their order: the name of an attribute, or ``key=attribute`` where the file has another word for
    it; `more`: keys that come after them.
    """
    pairs = (word.partition("=") for word in keys.split())
    return {key: attrgetter(attribute or key)(value) for key, _, attribute in pairs} | more


def read_json(path: Path, expected_format: str) -> dict[str, Any]:
    """Read an object whose key ``format`` is `expected_format`."""
    path = Path(path)
    try:
        content = json.loads(read_text(path, LONGEST_JSON))
    except DataError:
        raise
    except (ValueError, RecursionError) as error:
        # JSON, text, and numbers of more digits than Python reads.
        raise DataError(f"{path}: not a JSON file ({error})") from error
    found = content.get("format") if isinstance(content, dict) else None
    if not isinstance(content, dict) or found != expected_format:
        raise DataError(f"{path}: format is {found!r}, expected '{expected_format}'")
    return content


def _text(content: Any, margin: str) -> str:
    """JSON of `content`; `margin` begins each of its lines but the first."""
    deeper = margin + " "
    if isinstance(content, dict) and content:
        entries = [f"{_line(str(key))}: {_text(value, deeper)}" for key, value in content.items()]
        return f"{{{deeper}{f',{deeper}'.join(entries)}{margin}}}"
    if _is_table(content):
        return f"[{deeper}{f',{deeper}'.join(_text(value, deeper) for value in content)}{margin}]"
    return _line(content.tolist() if isinstance(content, np.ndarray) else content)


def _is_table(content: Any) -> bool:
    """Whether there are lists or objects among the entries of a list."""
    if isinstance(content, np.ndarray):
        return content.ndim > 1 and len(content) > 0
    return isinstance(content, list | tuple) and any(isinstance(value, _NESTED) for value in content)


_NESTED = (dict, list, tuple, np.ndarray)
_STRICT = json.JSONEncoder(allow_nan=False)


def _line(content: Any) -> str:
    """JSON on one line."""
    try:
        return _STRICT.encode(content)
    except (TypeError, ValueError):
        plain = [_plain(value) for value in content] if isinstance(content, list | tuple) else _plain(content)
        return _STRICT.encode(plain)


def _plain(value: Any) -> Any:
    """Replace a number of numpy by one of Python, and one that is not finite by None."""
    if isinstance(value, np.generic):
        value = value.item()
    return None if isinstance(value, float) and not math.isfinite(value) else value
