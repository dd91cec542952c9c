"""A part of a recording, as a bag of its own."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from sdimu_calibration.core.arrays import Ints
from sdimu_calibration.core.data.stray_stamps import stray_note, stray_stamps, strays, strays_note
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.storage.bags import cdr
from sdimu_calibration.storage.bags.bag_file import TopicContent, read_topics
from sdimu_calibration.storage.bags.bag_folder import check_apart, check_room
from sdimu_calibration.storage.bags.bag_metadata import custom_data
from sdimu_calibration.storage.bags.mcap_bag import McapBag

_TAKEN = (cdr.STATUS, cdr.IMU, cdr.JOINT_STATE, cdr.TEMPERATURE)
"""In the order in which messages of one stamp are written: a status holds from its stamp on."""


@dataclass(frozen=True)
class Part:
    """What a cut left: messages by topic, and the whole recording's length (s)."""

    counts: dict[str, int]
    whole_s: float
    notes: tuple[str, ...] = ()
    """Which messages are left out because their stamps are of no time of the test."""


def cut_bag(source: Path, target: Path, first_s: float, last_s: float, *, replace: bool = False) -> Part:
    """Write the messages between two times into a bag; what the calibration does not read is left out.

    Messages whose stamp is of no time of the test are left out, by the rule of all who read a recording: a sample
    stamped days ahead would be its end.

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
    """
    check_apart(source, target)
    check_room(target, replace)
    if not first_s < last_s:
        raise DataError(f"--from {first_s:g} --to {last_s:g}: nothing lies between these times (s)")
    every = read_topics(source, lambda _topic, kind: kind in _TAKEN)
    found = {topic: content for topic, content in every.items() if content.type_name in _TAKEN}
    ranked = sorted(found, key=lambda topic: _TAKEN.index(found[topic].type_name))
    stamped, notes = _of_the_test({topic: list(found[topic].raw) for topic in ranked}, _imu_topics(found))
    imu = [ns for topic, (ns, _) in stamped.items() if found[topic].type_name == cdr.IMU and len(ns)]
    if not imu:
        raise DataError(f"{source}: no message of {cdr.IMU} is in it")
    start, end = min(int(ns[0]) for ns in imu), max(int(ns[-1]) for ns in imu)
    # Times beyond both ends, however far, are those of the ends.
    whole_s = (end - start) * 1e-9
    low = start + round(min(max(first_s, 0.0), whole_s + 1.0) * 1e9)
    high = start + round(last_s * 1e9) if last_s <= whole_s else np.iinfo(np.int64).max
    kept = {topic: _between(*stamped[topic], low, high, found[topic].type_name == cdr.STATUS) for topic in ranked}
    if not any(len(kept[topic][0]) for topic in ranked if found[topic].type_name == cdr.IMU):
        raise DataError(f"{source}: no sample between {first_s:g} and {last_s:g} s; it is {whole_s:.1f} s long")
    with McapBag(target, replace=replace, custom=custom_data(source)) as bag:
        for topic, content in found.items():
            bag.topic(topic, content.type_name)
        bag.write_merged(kept)
        counts = dict(bag.counts)
    return Part(counts, whole_s, notes)


def _imu_topics(found: Mapping[str, TopicContent]) -> set[str]:
    return {topic for topic, content in found.items() if content.type_name == cdr.IMU}


def _of_the_test(
    raw: Mapping[str, list[bytes]], imu: set[str]
) -> tuple[dict[str, tuple[Ints, list[bytes]]], tuple[str, ...]]:
    """Messages of each topic by their stamps, without those of no time of the test; notes where there were some.

    Parameters
    ----------
    raw : mapping of str to list of bytes
        By topic, in the order of arrival.
    imu : set of str
        Topics of samples: what is of the time of the test is told by them.
    """
    stamped, notes = {topic: cdr.by_stamp(messages, topic) for topic, messages in raw.items()}, []
    for topic in sorted(imu):
        arrived = np.fromiter(map(cdr.stamp_of, raw[topic]), np.int64, len(raw[topic]))
        away = stray_stamps(arrived)
        if len(away):
            notes.append(f"{topic}: {stray_note(arrived[away])}")
            gone = set(away.tolist())
            stamped[topic] = cdr.by_stamp([m for k, m in enumerate(raw[topic]) if k not in gone], topic)
    samples = np.sort(np.concatenate([stamped[topic][0] for topic in imu])) if imu else np.empty(0, dtype=np.int64)
    for topic in sorted(raw.keys() - imu) if len(samples) > 1 else ():
        ns, messages = stamped[topic]
        if len(ns) and (away_from := strays(ns, samples)).any():
            notes.append(strays_note(topic, ns[away_from]))
            kept = np.flatnonzero(~away_from)
            stamped[topic] = ns[kept], [messages[k] for k in kept.tolist()]
    return stamped, tuple(notes)


def _between(ns: Ints, messages: list[bytes], low: int, high: int, holds: bool) -> tuple[Ints, list[bytes]]:
    """Messages between two stamps; of what holds until the next message also the last one before, from `low` on."""
    first, last = int(np.searchsorted(ns, low)), int(np.searchsorted(ns, high, side="right"))
    if not holds or not first:
        return ns[first:last], messages[first:last]
    before = cdr.stamped(messages[first - 1], low)
    return np.append(np.int64(low), ns[first:last]), [before, *messages[first:last]]
