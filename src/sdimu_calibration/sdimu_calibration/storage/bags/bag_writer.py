"""A whole test written to a rosbag2 folder at once."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from sdimu_calibration.core.arrays import Bools, Floats, Ints
from sdimu_calibration.storage.bags import cdr
from sdimu_calibration.storage.bags.mcap_bag import McapBag
from sdimu_calibration.storage.bags.topic_choice import Topics

Stamps = Ints


@dataclass(frozen=True)
class BagContent:
    """What the topics of a test hold."""

    start_ns: int
    """Added to every stamp: the time (ns since 1970) at which the test began."""
    imu_ns: Stamps
    """End of each sample's interval (ns after `start_ns`), shape (n,)."""
    omega_ib_b: Floats
    f_ib_b: Floats
    """`omega_ib_b`, `f_ib_b`: mean rate (rad/s) and specific force (m/s^2) over the interval, in the frame of the IMU,
    shape (n, 3)."""
    status: tuple[Stamps, Bools, Ints] | None = None
    """Stamp (ns after `start_ns`), True for dwell, index of the stop."""
    joint_states: tuple[Stamps, tuple[str, ...], Floats, Floats] | None = None
    """Stamp (ns after `start_ns`), axes, angles (rad), rates (rad/s)."""
    temperature: tuple[Stamps, Floats] | None = None
    """Stamp (ns after `start_ns`), temperature (deg C)."""


def write_recording(
    path: Path,
    content: BagContent,
    *,
    topics: Topics | None = None,
    replace: bool = False,
    custom: Mapping[str, str] | None = None,
) -> None:
    """Write a test to a bag, all messages in the order of their stamps.

    Parameters
    ----------
    path : Path
        Folder to make.
    topics : Topics, optional
        Names of the topics; by default those of the simulators.
    replace : bool
        Delete a bag that is already there.
    custom : mapping of str to str, optional
        What the user says of the recording: ``serial``, ``power_on``.
    """
    topics, start_ns, imu_ns = topics or Topics(), content.start_ns, content.imu_ns
    samples = cdr.encode_imu(imu_ns + start_ns, content.omega_ib_b, content.f_ib_b)
    streams = {topics.imu: (cdr.IMU, imu_ns, samples)}
    if content.status is not None:
        ns, dwell, stop = content.status
        # At the same stamp the status goes first, as it holds from that stamp on.
        streams = {topics.status: (cdr.STATUS, ns, cdr.encode_status(ns + start_ns, dwell, stop))} | streams
    if content.joint_states is not None:
        ns, names, position, velocity = content.joint_states
        encoded = cdr.encode_joint_states(ns + start_ns, names, position, velocity)
        streams[topics.joint_states] = (cdr.JOINT_STATE, ns, encoded)
    if content.temperature is not None:
        ns, value = content.temperature
        streams[topics.temperature] = (cdr.TEMPERATURE, ns, cdr.encode_temperature(ns + start_ns, value))
    with McapBag(path, replace=replace, custom=custom) as bag:
        for topic, (type_name, _, _) in streams.items():
            bag.topic(topic, type_name)
        stamped = {topic: (np.asarray(ns, np.int64) + start_ns, data) for topic, (_, ns, data) in streams.items()}
        bag.write_merged(stamped)
