"""Spans of time as options state them, and rests in a file."""

from __future__ import annotations

import re
from pathlib import Path

from sdimu_calibration.core.data_error import DataError

Spans = tuple[tuple[float, float], ...]
_SPAN = re.compile(r"\s*(\d+(?:\.\d+)?)\s*-\s*(\d+(?:\.\d+)?)\s*")
_PAIR = re.compile(r"\s*(\d+(?:\.\d+)?)(?:\s*[,;-]\s*|\s+)(\d+(?:\.\d+)?)\s*[,;]?\s*")


def read_spans(text: str, option: str = "--exclude-times") -> Spans:
    """Read spans of time (s), such as ``812-815,900-910``, in ascending order."""
    found = [_SPAN.fullmatch(word) for word in text.split(",")]
    if not all(found):
        raise DataError(f"{option} {text}: expected spans of seconds such as 812-815,900-910")
    return _ascending([(float(match[1]), float(match[2])) for match in found if match], f"{option} {text}")


def read_rests(text: str) -> Spans:
    """Read the rests of a run by hand (s): spans, or the path of a file with begin and end of one on each line."""
    if _SPAN.fullmatch(text.split(",", maxsplit=1)[0]):
        return read_spans(text, "--rests")
    path = Path(text)
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise DataError(
            f"--rests {text}: expected spans of seconds such as 10-13,15.5-18, or a text file with begin and end of a "
            "rest on each line"
        ) from error
    spans: list[tuple[float, float]] = []
    for number, line in enumerate(lines, start=1):
        words = line.partition("#")[0]
        if not words.strip():
            continue
        match = _PAIR.fullmatch(words)
        if match is None:
            if not spans and not any(c.isdigit() for c in words):
                continue
            raise DataError(f"{path}: line {number}: '{line.strip()}': expected begin and end of a rest (s)")
        spans.append((float(match[1]), float(match[2])))
    if not spans:
        raise DataError(f"{path}: no rest in it: expected begin and end of one (s) on each line")
    return _ascending(spans, str(path))


def _ascending(spans: list[tuple[float, float]], where: str) -> Spans:
    for begin, end in spans:
        if end <= begin:
            raise DataError(f"{where}: the span {begin:g}-{end:g} ends before it begins")
    return tuple(sorted(spans))
