"""Damaged files of every format: told in one line or read right; never a traceback, a hang, or a silent change."""

from __future__ import annotations

import os
import resource
import shutil
import signal
import traceback
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from sdimu_calibration.core.plain_text import LONGEST_LINE
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.units import UnitError

from .fleet_formats import FLEET_FORMATS
from .formats import FORMATS as OTHERS
from .formats import Format

FORMATS = OTHERS | FLEET_FORMATS

LONGEST_S = 10.0
"""Time (s) of one case beyond which it hangs: the slowest sound file takes one."""
SHORT = {"MAT": 4, "MAT, packed": 4, "MAT, timetable": 4, "MAT, 7.3": 4, "bag, SQLite": 8}
"""Cases in the short run; those with a process of their own take half a second each."""
LONG = {
    "MAT": 250,
    "MAT, packed": 250,
    "MAT, timetable": 200,
    "MAT, 7.3": 200,
    "bag": 1500,
    "bag, right checksums": 1500,
    "bag, right records": 1500,
    "bag, right layouts": 1500,
}


class HangError(Exception):
    """A case took too long."""


def hang(*_):
    raise HangError


def outcome(kind: Format, sound: bytes, expected: object, seed: int, folder: Path) -> tuple[str, str]:
    """One word for what a damaged file led to, and what was said."""
    damaged = kind.damage(sound, np.random.default_rng(seed))
    if damaged == sound:
        return "unchanged", ""
    path = folder / kind.name
    path.write_bytes(damaged)
    before = signal.signal(signal.SIGALRM, hang)
    signal.setitimer(signal.ITIMER_REAL, LONGEST_S)
    try:
        found = kind.read(path)
    except (DataError, UnitError) as error:
        text = str(error)
        return ("told", text) if text.isprintable() and len(text) <= LONGEST_LINE else ("told badly", repr(text))
    except HangError:
        return "hang", traceback.format_exc()
    except BaseException:
        return "traceback", traceback.format_exc()
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
    if kind.same is not None and not kind.same(expected, found):
        return "silent change", ""
    return "read", ""


def run(name: str, number: int, folder: Path) -> tuple[Counter[str], list[str]]:
    kind = FORMATS[name]
    place = folder / "sound"
    place.mkdir()
    sound = kind.make(place)
    expected = None
    if kind.same is not None:
        (place / kind.name).write_bytes(sound)
        expected = kind.read(place / kind.name)
    counts: Counter[str] = Counter()
    bad = []
    for seed in range(number):
        case = folder / "case"
        case.mkdir()
        word, said = outcome(kind, sound, expected, seed, case)
        shutil.rmtree(case)
        counts[word] += 1
        if word not in {"unchanged", "told", "read"}:
            bad.append(f"{name}, seed {seed}: {word}\n{said}")
    return counts, bad


@pytest.mark.parametrize("name", sorted(FORMATS))
def test_a_damaged_file_is_told_or_read_right(name, tmp_path):
    counts, bad = run(name, SHORT.get(name, 20), tmp_path)
    assert bad == []
    # Damage that changes nothing tries nothing.
    assert counts["told"] + counts["read"] > 0.5 * sum(counts.values())


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(FORMATS))
def test_thousands_of_damaged_files_are_told_or_read_right(name, tmp_path, capsys):
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    counts, bad = run(name, int(os.environ.get("SDIMU_MUTATIONS", "0")) or LONG.get(name, 500), tmp_path)
    grown = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) // 1024
    with capsys.disabled():
        print(f"\n{name}: {sum(counts.values())}, {dict(counts)}, {grown} MB")  # noqa: T201
    assert bad == []
    assert grown < 1024
