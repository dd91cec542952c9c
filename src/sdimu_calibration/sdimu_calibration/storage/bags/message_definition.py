"""Message definitions as MCAP wants them: text of the installed .msg files, dependencies appended.

The MCAP registry calls the format ``ros2msg``: the text of the type itself, then every type it uses, each
after a line of 80 ``=`` and a line ``MSG: package/Type``.
"""

from __future__ import annotations

import importlib.util
import json
import os
import re
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path

from sdimu_calibration.core.recording import DataError

_NUMBERS = frozenset(
    f"{kind}{bits}"
    for kind, sizes in (("float", (32, 64)), ("int", (8, 16, 32, 64)), ("uint", (8, 16, 32, 64)))
    for bits in sizes
)
_PRIMITIVES = _NUMBERS | {"bool", "byte", "char", "string", "wstring"}
_SEPARATOR = "=" * 80
_KNOWN = {("tf2_msgs", "TFMessage"): "geometry_msgs/TransformStamped[] transforms\n"}
"""Types that are recorded although no wheel brings their definition."""


@cache
def definition(type_name: str) -> str:
    """Text of a message type and of all types in it.

    Parameters
    ----------
    type_name : str
        Such as ``sensor_msgs/msg/Imu``.
    """
    package, name = _split(type_name)
    texts = {(package, name): _text(package, name)}
    waiting = [(package, name)]
    while waiting:
        for used in _used(waiting[0][0], texts[waiting[0]]):
            if used not in texts:
                texts[used] = _text(*used)
                waiting.append(used)
        waiting.pop(0)
    main, *others = texts.items()
    parts = [main[1]] + [f"{_SEPARATOR}\nMSG: {key[0]}/{key[1]}\n{text}" for key, text in others]
    return "\n".join(part.rstrip("\n") for part in parts) + "\n"


@cache
def type_hash(type_name: str) -> str:
    """RIHS01 hash of a message type (REP 2016), empty when the installation does not say."""
    package, name = _split(type_name)
    path = _file(package, name, ".json")
    if path is None:
        return ""
    hashes = json.loads(path.read_text(encoding="utf-8")).get("type_hashes", [])
    return next((str(h["hash_string"]) for h in hashes if h["type_name"] == f"{package}/msg/{name}"), "")


def _split(type_name: str) -> tuple[str, str]:
    match = re.fullmatch(r"(\w+)/(?:msg/)?(\w+)", type_name)
    if not match:
        raise DataError(f"'{type_name}' is not a message type (expected something like 'sensor_msgs/msg/Imu')")
    return match.group(1), match.group(2)


def _text(package: str, name: str) -> str:
    path = _file(package, name, ".msg")
    if path is None and (package, name) in _KNOWN:
        return _KNOWN[package, name]
    if path is None:
        raise DataError(f"no definition of {package}/msg/{name}: install the ROS package '{package}'")
    return path.read_text(encoding="utf-8")


def _file(package: str, name: str, suffix: str) -> Path | None:
    paths = (prefix / "share" / package / "msg" / f"{name}{suffix}" for prefix in _prefixes(package))
    return next((path for path in paths if path.is_file()), None)


def _prefixes(package: str) -> Iterator[Path]:
    """Installation prefixes, nearest first: the ament index, this environment, around the Python package."""
    yield from (Path(p) for p in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep) if p)
    yield Path(sys.prefix)
    spec = importlib.util.find_spec(package)
    if spec is not None and spec.origin:
        yield from Path(spec.origin).parents


def _used(package: str, text: str) -> Iterator[tuple[str, str]]:
    """Types of the fields of a .msg text that are messages themselves, as (package, name)."""
    for line in text.splitlines():
        code = line.partition("#")[0].split()
        if not code:
            continue
        base = re.sub(r"(<=\d+)?(\[.*\])?$", "", code[0])
        if base not in _PRIMITIVES:
            yield _split(base if "/" in base else f"{package}/{base}")
