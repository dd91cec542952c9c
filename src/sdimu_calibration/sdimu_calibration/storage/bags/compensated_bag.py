"""A recording compensated into another bag, at full speed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from sdimu_calibration.core.compensation import Compensated, Compensator, compensate, heat_since
from sdimu_calibration.core.recording import Recording
from sdimu_calibration.storage.bags import cdr
from sdimu_calibration.storage.bags.bag_file import read_topics
from sdimu_calibration.storage.bags.bag_folder import check_apart, check_room
from sdimu_calibration.storage.bags.bag_metadata import custom_data
from sdimu_calibration.storage.bags.mcap_bag import McapBag

COMPENSATED = "/imu/data"
_COPIED = (cdr.STATUS, cdr.JOINT_STATE, cdr.TEMPERATURE)
_BLOCK = 20_000
"""Samples worked on at once: bounds the memory of long recordings."""


@dataclass(frozen=True)
class Written:
    """What came of it: samples written, largest change of a rate (rad/s) and of a force (m/s^2)."""

    samples: int
    largest_rate: float
    largest_force: float


def write_compensated(
    source: Path,
    recording: Recording,
    using: Compensator,
    target: Path,
    frame_id: str,
    *,
    replace: bool = False,
    progress: Callable[[str, float], None] | None = None,
) -> Written:
    """Write a bag with the compensated samples of a recording, and its other topics as they are.

    Parameters
    ----------
    source : Path
        Bag of the recording, from which the other topics are copied.
    target : Path
        Folder to make.
    replace : bool
        Delete a bag that is already there.
    """
    check_apart(source, target)
    check_room(target, replace)
    # By type: the topics may have any name, and keep it.
    others = {t: c for t, c in read_topics(source, lambda _, kind: kind in _COPIED).items() if c.raw}
    stamps = recording.start_ns + np.rint(recording.t * 1e9).astype(np.int64)
    interval = recording.interval_s
    heat = heat_since(recording.temperature, recording.t - 0.5 * interval, using.start_temperature, causal=False)
    largest = np.zeros(6)
    copied = {topic: cdr.by_stamp(content.raw, topic) for topic, content in others.items()}
    # A block takes what comes until its last sample, the last one all that is left.
    edges = [*stamps[_BLOCK - 1 : -1 : _BLOCK].tolist(), max((int(ns[-1]) for ns, _ in copied.values()), default=0)]
    places = {t: [0, *np.searchsorted(ns, edges, side="right").tolist()] for t, (ns, _) in copied.items()}
    with McapBag(target, replace=replace, custom=custom_data(source)) as bag:
        bag.topic(COMPENSATED, cdr.IMU)
        for topic, content in others.items():
            bag.topic(topic, content.type_name)
        for block, first in enumerate(range(0, len(stamps), _BLOCK)):
            rows = slice(first, first + _BLOCK)
            done = compensate(
                using,
                recording.t[rows],
                interval,
                recording.omega_ib_b[rows],
                recording.f_ib_b[rows],
                (heat[0][rows], heat[1][rows]),
            )
            change = np.hstack([done.omega_ib_b - recording.omega_ib_b[rows], done.f_ib_b - recording.f_ib_b[rows]])
            largest = np.maximum(largest, np.abs(change).max(axis=0))
            encoded = encode_compensated(stamps[rows], done, frame_id)
            due = {topic: slice(*places[topic][block : block + 2]) for topic in copied}
            # At the same stamp the status goes first, as it holds from that stamp on.
            before = {topic: (ns[due[topic]], messages[due[topic]]) for topic, (ns, messages) in copied.items()}
            bag.write_merged(before | {COMPENSATED: (stamps[rows], encoded)})
            if progress is not None:
                progress("compensate", min(1.0, (first + _BLOCK) / len(stamps)))
    return Written(len(stamps), float(largest[:3].max()), float(largest[3:].max()))


def frame_of(body_frame: str) -> str:
    """Name the frame of compensated samples: no longer the axes of the housing, but those of the coefficients."""
    return f"imu_{body_frame}"


def encode_compensated(stamp_ns: cdr.Stamps, samples: Compensated, frame_id: str) -> list[bytes]:
    """Encode compensated samples as sensor_msgs/Imu, each with its covariances."""
    covariances = samples.omega_covariance, samples.f_covariance
    return cdr.encode_imu(np.asarray(stamp_ns), samples.omega_ib_b, samples.f_ib_b, frame_id, covariances)
