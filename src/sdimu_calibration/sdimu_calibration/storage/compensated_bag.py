"""A recording compensated into another bag, at full speed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from sdimu_calibration.core.compensation import Compensator, compensate, heat_since
from sdimu_calibration.core.recording import Recording
from sdimu_calibration.storage import cdr
from sdimu_calibration.storage.bag_file import read_topics
from sdimu_calibration.storage.compensated_imu import encode_compensated
from sdimu_calibration.storage.mcap_bag import McapBag

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
    recording : Recording
    using : Compensator
    target : Path
        Folder to make.
    frame_id : str
        Of the compensated samples.
    replace : bool
        Delete a bag that is already there.
    progress : callable, optional

    Raises
    ------
    DataError
        When something is in the way of the folder, or the errors cannot be inverted.
    """
    # By type: the topics may have any name, and keep it.
    others = {t: c for t, c in read_topics(source, lambda _, kind: kind in _COPIED).items() if c.raw}
    stamps = recording.start_ns + np.rint(recording.t * 1e9).astype(np.int64)
    interval = recording.interval_s
    heat = heat_since(recording.temperature, recording.t - 0.5 * interval, using.start_temperature, causal=False)
    largest = np.zeros(6)
    copied = [(cdr.stamp_of(m), topic, m) for topic, content in others.items() for m in content.raw]
    copied.sort(key=lambda entry: entry[0])
    next_copy = 0
    with McapBag(target, replace=replace) as bag:
        bag.topic(COMPENSATED, cdr.IMU)
        for topic, content in others.items():
            bag.topic(topic, content.type_name)
        for first in range(0, len(stamps), _BLOCK):
            rows = slice(first, first + _BLOCK)
            done = compensate(
                using, recording.t[rows], interval, recording.omega_ib_b[rows], recording.f_ib_b[rows],
                (heat[0][rows], heat[1][rows]),
            )  # fmt: skip
            change = np.hstack([done.omega_ib_b - recording.omega_ib_b[rows], done.f_ib_b - recording.f_ib_b[rows]])
            largest = np.maximum(largest, np.abs(change).max(axis=0))
            encoded = encode_compensated(stamps[rows], done, frame_id)
            for stamp, message in zip(stamps[rows].tolist(), encoded, strict=True):
                # At the same stamp the status goes first, as it holds from that stamp on.
                while next_copy < len(copied) and copied[next_copy][0] <= stamp:
                    bag.write(copied[next_copy][1], copied[next_copy][2], copied[next_copy][0])
                    next_copy += 1
                bag.write(COMPENSATED, message, stamp)
            if progress is not None:
                progress("compensate", min(1.0, (first + _BLOCK) / len(stamps)))
        for stamp, topic, message in copied[next_copy:]:
            bag.write(topic, message, stamp)
    return Written(len(stamps), float(largest[:3].max()), float(largest[3:].max()))
