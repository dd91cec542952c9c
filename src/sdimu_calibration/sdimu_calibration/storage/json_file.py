"""Strict JSON files: no NaN, and whole or not there at all."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np

from sdimu_calibration.core.recording import DataError


def write_json(path: Path, content: Any) -> None:
    """Write `content`; numbers that are not finite become ``null``; the folder is made.

    The file is written beside its place and renamed, so that a reader never meets half of it.
    """
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f".{path.name}.part")
    temporary.write_text(json.dumps(_plain(content), allow_nan=False, indent=1) + "\n", encoding="utf-8")
    temporary.replace(path)


def read_json(path: Path, expected_format: str) -> dict[str, Any]:
    """Read an object whose key ``format`` is `expected_format`.

    Raises
    ------
    DataError
        When there is no such file, or it is something else.
    """
    path = Path(path)
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError as error:
        raise DataError(f"{path}: no such file") from error
    except (UnicodeDecodeError, json.JSONDecodeError) as error:
        raise DataError(f"{path}: not a JSON file ({error})") from error
    found = content.get("format") if isinstance(content, dict) else None
    if not isinstance(content, dict) or found != expected_format:
        raise DataError(f"{path}: format is {found!r}, expected '{expected_format}'")
    return content


def _plain(content: Any) -> Any:
    """Replace numpy by Python and non-finite numbers by None, all the way down."""
    if isinstance(content, dict):
        return {str(key): _plain(value) for key, value in content.items()}
    if isinstance(content, list | tuple):
        return [_plain(value) for value in content]
    if isinstance(content, np.ndarray):
        return _plain(content.tolist())
    if isinstance(content, np.generic):
        content = content.item()
    return None if isinstance(content, float) and not math.isfinite(content) else content
