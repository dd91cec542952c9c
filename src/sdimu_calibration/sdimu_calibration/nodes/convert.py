"""Stamps of messages as they travel (CDR bytes), where message objects would cost too much."""

from __future__ import annotations

import re

NS = 1_000_000_000

_STAMP_LABEL = re.compile(rb"stamp_ns=(-?\d+)")


def stamp_of(message: bytes) -> int:
    """Stamp (ns) of the header with which a little-endian CDR message begins."""
    sec = int.from_bytes(message[4:8], "little", signed=True)
    return sec * NS + int.from_bytes(message[8:12], "little")


def stamp_in_label(message: bytes) -> int:
    """Stamp (ns) in the label ``stamp_ns=...`` of a CDR multi-array; 0 without one."""
    found = _STAMP_LABEL.search(message)
    return int(found.group(1)) if found else 0
