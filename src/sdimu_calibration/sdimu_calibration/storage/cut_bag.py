"""A part of a recording, as a bag of its own."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

from sdimu_calibration.core.recording import DataError
from sdimu_calibration.storage import cdr
from sdimu_calibration.storage.bag_file import read_topics
from sdimu_calibration.storage.mcap_bag import McapBag

_TAKEN = (cdr.STATUS, cdr.IMU, cdr.JOINT_STATE, cdr.TEMPERATURE)
"""In the order in which messages of one stamp are written: a status holds from its stamp on."""


@dataclass(frozen=True)
class Part:
    """What a cut left: messages by topic, and the whole recording's length (s)."""

    counts: dict[str, int]
    whole_s: float


def cut_bag(source: Path, target: Path, first_s: float, last_s: float, *, replace: bool = False) -> Part:
    """Write the messages between two times into a bag; what the calibration does not read is left out.

    A table says its phase when it changes: the last status before the cut is kept, with the stamp of the cut.

    Parameters
    ----------
    source : Path
        Bag of any kind that is read.
    target : Path
        Folder to make.
    first_s, last_s : float
        Seconds since the first stamp of an IMU, as errors and reports count them; both ends are kept.
    replace : bool
        Delete a bag that is already there.

    Raises
    ------
    DataError
        When there is no IMU in the bag, no sample between the times, or something in the way of the folder.
    """
    if not first_s < last_s:
        raise DataError(f"--from {first_s:g} --to {last_s:g}: nothing lies between these times (s)")
    found = read_topics(source, lambda _topic, kind: kind in _TAKEN)
    stamped = {
        topic: sorted(((cdr.stamp_of(m), m) for m in content.raw), key=lambda entry: entry[0])
        for topic, content in found.items()
    }
    imu = [entries for topic, entries in stamped.items() if found[topic].type_name == cdr.IMU and entries]
    if not imu:
        raise DataError(f"{source}: no message of {cdr.IMU} is in it")
    start = min(entries[0][0] for entries in imu)
    end = max(entries[-1][0] for entries in imu)
    low = start + round(first_s * 1e9)
    high = start + round(last_s * 1e9) if math.isfinite(last_s) else max(e[-1][0] for e in stamped.values() if e)
    kept: list[tuple[int, int, str, bytes]] = []
    for topic, entries in stamped.items():
        rank = _TAKEN.index(found[topic].type_name)
        inside = [(ns, m) for ns, m in entries if low <= ns <= high]
        if found[topic].type_name == cdr.STATUS:
            inside = [(low, cdr.stamped(m, low)) for ns, m in entries if ns < low][-1:] + inside
        kept += [(ns, rank, topic, m) for ns, m in inside]
    if not any(rank == _TAKEN.index(cdr.IMU) for _ns, rank, _topic, _m in kept):
        raise DataError(
            f"{source}: no sample between {first_s:g} and {last_s:g} s; it is {(end - start) * 1e-9:.1f} s long"
        )
    kept.sort(key=lambda entry: entry[:2])
    with McapBag(target, replace=replace) as bag:
        for topic, content in found.items():
            bag.topic(topic, content.type_name)
        for ns, _rank, topic, message in kept:
            bag.write(topic, message, ns)
        counts = dict(bag.counts)
    return Part(counts, (end - start) * 1e-9)
