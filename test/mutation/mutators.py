"""Damage to a file, drawn by a number: the same number makes the same damage everywhere."""

from __future__ import annotations

import json
from collections.abc import Callable
from copy import deepcopy
from typing import Any

import numpy as np

Random = np.random.Generator
EXTREMES = tuple(value.to_bytes(8, "little") for value in (0, 1, 22, 2**31 - 1, 2**32 - 1, 2**40, 2**63, 2**64 - 1))
WORDS = (
    "",
    "null",
    "true",
    "nan",
    "inf",
    "-1",
    "0",
    "1e400",
    "-1e-400",
    "9" * 400,
    "9" * 5000,
    "1" * 30,
    "٣",
    "½",
    "!!int x",
    "!!float y",
    "!!python/object:os.system x",
    "2024-99-99",
    "2024-01-01",
    "*a",
    "&a [*a]",
    "[" * 60,
    "{" * 60,
    "[[1, 2], [3]]",
    "{a: {b: c}}",
    "ax**(1/0)",
    "k**k",
    "1/0",
    "sin(",
    "__import__('os')",
    "\x1b[2J",
    "\u202e",
    "\x00",
    "a\tb",
    "\r\n",
    "deg/h/h/h",
    "deg^99",
    "1 deg/s",
    "5 parsec",
    "../../x",
    "-",
    "?",
    "#",
    ": :",
    "'",
    '"',
    "|",
    "%YAML 9",
)
"""What stands in files of people who err, and of people who attack."""
VALUES: tuple[Any, ...] = (
    None,
    True,
    -1,
    0,
    10**400,
    1e308,
    float("nan"),
    "",
    "x" * 10_000,
    "\x1b[2J\n",
    [],
    {},
    [[]],
    [None],
    {"a": 1},
    [1, "a"],
    "2024-99-99",
)


def damaged_bytes(content: bytes, rng: Random) -> bytes:
    """Change, cut, repeat or overwrite a part of a file."""
    out = bytearray(content)
    for _ in range(int(rng.integers(1, 4))):
        _BYTES[int(rng.integers(len(_BYTES)))](out, rng)
    return bytes(out)


def _place(out: bytearray, rng: Random) -> int:
    # Heads and tails say how the rest is to be read: they are hit as often as all that is between.
    edge = min(len(out), 400)
    where = int(rng.integers(3))
    if where == 0:
        return int(rng.integers(edge + 1))
    return len(out) - int(rng.integers(edge + 1)) if where == 1 else int(rng.integers(len(out) + 1))


def _length(rng: Random) -> int:
    return int(2 ** rng.uniform(0, 12))


def _flip(out: bytearray, rng: Random) -> None:
    place = _place(out, rng)
    if place < len(out):
        out[place] ^= 1 << int(rng.integers(8))


def _overwrite(out: bytearray, rng: Random) -> None:
    place = _place(out, rng)
    size = int(rng.choice([1, 2, 4, 8]))
    out[place : place + size] = EXTREMES[int(rng.integers(len(EXTREMES)))][:size]


def _cut(out: bytearray, rng: Random) -> None:
    del out[_place(out, rng) :]


def _leave_out(out: bytearray, rng: Random) -> None:
    place = _place(out, rng)
    del out[place : place + _length(rng)]


def _repeat(out: bytearray, rng: Random) -> None:
    place, size = _place(out, rng), _length(rng)
    out[place:place] = out[place : place + size]


def _insert(out: bytearray, rng: Random) -> None:
    place = _place(out, rng)
    out[place:place] = rng.bytes(_length(rng) % 64 + 1)


def _move(out: bytearray, rng: Random) -> None:
    source, target, size = _place(out, rng), _place(out, rng), _length(rng)
    out[target : target + size] = out[source : source + size]


def _zero(out: bytearray, rng: Random) -> None:
    place, size = _place(out, rng), _length(rng)
    out[place : place + size] = bytes(len(out[place : place + size]))


_BYTES: tuple[Callable[[bytearray, Random], None], ...] = (
    _flip,
    _flip,
    _overwrite,
    _overwrite,
    _cut,
    _leave_out,
    _repeat,
    _insert,
    _move,
    _zero,
)


def damaged_text(content: bytes, rng: Random) -> bytes:
    """Put words where others were, lines where they do not belong, and sometimes damage bytes."""
    if rng.random() < 0.2:
        return damaged_bytes(content, rng)
    lines = content.decode().split("\n")
    for _ in range(int(rng.integers(1, 4))):
        k = int(rng.integers(len(lines)))
        kind = int(rng.integers(5))
        word = WORDS[int(rng.integers(len(WORDS)))]
        if kind == 0:
            lines[k : k + 1] = []
            lines = lines or [""]
        elif kind == 1:
            lines.insert(k, lines[int(rng.integers(len(lines)))])
        elif kind == 2:
            # The value behind a key, or the last cell.
            mark = ":" if ":" in lines[k] else ","
            lines[k] = lines[k].rpartition(mark)[0] + mark + " " + word
        elif kind == 3:
            at = int(rng.integers(len(lines[k]) + 1))
            lines[k] = lines[k][:at] + word + lines[k][at + int(rng.integers(4)) :]
        else:
            lines[k] = " " * int(rng.integers(5)) + lines[k].lstrip()
    return "\n".join(lines).encode("utf-8", "surrogatepass")


def damaged_json(content: bytes, rng: Random) -> bytes:
    """Put other values into the tree of a JSON file, take keys out, and sometimes damage its text."""
    if rng.random() < 0.3:
        return damaged_text(content, rng)
    tree = json.loads(content)
    for _ in range(int(rng.integers(1, 3))):
        holder, key = tree, None
        # Down to a depth that the number chooses.
        for _ in range(int(rng.integers(1, 6))):
            inner = holder if key is None else holder[key]
            if not isinstance(inner, dict | list) or not inner:
                break
            holder = inner
            keys = list(holder) if isinstance(holder, dict) else range(len(holder))
            key = keys[int(rng.integers(len(keys)))]
        if key is None:
            continue
        if rng.random() < 0.3:
            del holder[key]
        else:
            holder[key] = deepcopy(VALUES[int(rng.integers(len(VALUES)))])
    return json.dumps(tree).encode()
