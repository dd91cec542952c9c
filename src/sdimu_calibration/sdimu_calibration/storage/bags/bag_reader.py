"""A bag read into a Recording, with everything that real recordings bring along."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cache, lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.data.arrival import RawStatus, RawTemperature, RawTest, in_order
from sdimu_calibration.core.recording import DataError, Recording, TableLog, seconds
from sdimu_calibration.storage.bags import cdr
from sdimu_calibration.storage.bags.bag_file import Keep, raw_messages, read_topics
from sdimu_calibration.storage.bags.cdr import LayoutError, Stamps
from sdimu_calibration.storage.bags.imu_messages import ImuMessages
from sdimu_calibration.storage.bags.raw_messages import RawMessages
from sdimu_calibration.storage.bags.status_message import phase_entry, phase_of, stamp_ns
from sdimu_calibration.storage.bags.topic_choice import KINDS, TopicChoice, Topics, choose


def read_recording(path: Path, topics: Topics | TopicChoice | None = None) -> Recording:
    """Read a bag.

    Samples that are not finite and samples with a stamp that was there before are dropped and counted;
    samples out of order are sorted by stamp. `notes` say what was mended.

    Parameters
    ----------
    path : Path
        rosbag2 folder (MCAP or SQLite, compressed or not), a bare .mcap or .db3 file, or a bag of ROS 1.
    topics : Topics or TopicChoice, optional
        Names of the topics; those that are not named are chosen by name and type of what is there.

    Returns
    -------
    Recording
        Time counts from one nominal sample interval before the first stamp.
    """
    path = Path(path)
    notes: list[str] = []
    topics, raw = read_messages(path, topics, notes, _kept)
    imu_topic = f"{path}: {topics.imu}"
    ns, omega_ib_b, f_ib_b = _imu(raw[topics.imu], imu_topic, notes)
    recording = in_order(
        RawTest(
            ns,
            omega_ib_b,
            f_ib_b,
            _status(raw.get(topics.status, []), topics.status, notes),
            _temperature(raw.get(topics.temperature, []), f"{path}: {topics.temperature}"),
            imu_topic,
            topics.status,
            topics.temperature,
        )
    )
    table = _table(raw.get(topics.joint_states, []), recording.start_ns, topics.joint_states, notes)
    return replace(recording, table=table, notes=(*notes, *recording.notes))


def read_messages(
    path: Path, topics: Topics | TopicChoice | None, notes: list[str], kept: Keep = lambda _: RawMessages()
) -> tuple[Topics, dict[str, RawMessages]]:
    """Read the messages of the topics of a test; `notes` gets what was chosen by type.

    What they go into is made by `kept`, from the type of the topic.

    Returns
    -------
    topics : Topics
    messages : dict of str to RawMessages
        By topic, as recorded (CDR).
    """
    if isinstance(topics, Topics):
        wanted = {getattr(topics, kind): type_name for kind, type_name in KINDS.items()}
        return topics, raw_messages(path, wanted, topics.imu, kept)
    content = read_topics(path, lambda _, type_name: type_name in KINDS.values(), kept)
    chosen = choose(path, content, topics or TopicChoice(), _is_phase, notes)
    return chosen, {t: content[t].raw for t in vars(chosen).values() if t in content}


def _is_phase(raw: bytes) -> bool:
    return phase_of(*_status_entry(raw)) is not None


def _status_entry(raw: bytes) -> tuple[str, Mapping[str, str]]:
    """Text and values of a status; empty where the message is none."""
    # A status is repeated every second: but for the stamp a test has few different ones.
    return _decoded_status(raw[:4] + raw[12:])


@lru_cache(maxsize=64)
def _decoded_status(without_stamp: bytes) -> tuple[str, Mapping[str, str]]:
    try:
        return cdr.decode_status(without_stamp[:4] + bytes(8) + without_stamp[4:])
    except LayoutError:
        return "", {}


def _status(raw: Sequence[bytes], topic: str, notes: list[str]) -> RawStatus | None:
    """Phases in the order of arrival; a message that says none is ignored."""
    found = (phase_entry(cdr.stamp_of(data), *_status_entry(data)) for data in raw if len(data) >= cdr.WITH_STAMP)
    parsed = [entry for entry in found if entry is not None]
    if len(parsed) < len(raw):
        notes.append(f"{len(raw) - len(parsed)} messages of {topic} said neither dwell nor rotating: ignored")
    if not parsed:
        return None
    ns, dwell, stop = zip(*parsed, strict=True)
    return RawStatus(np.array(ns, np.int64), np.array(dwell), np.array(stop, np.int64))


def _temperature(raw: Sequence[bytes], where: str) -> RawTemperature | None:
    if not raw:
        return None
    try:
        ns, values = cdr.decode_doubles(raw, 2)
        return RawTemperature(ns, values[:, 0])
    except LayoutError:
        return RawTemperature(*_one_by_one(raw, cdr.TEMPERATURE, lambda message: message.temperature, where))


def _table(raw: Sequence[bytes], start_ns: int, topic: str, notes: list[str]) -> TableLog | None:
    if not raw:
        return None
    try:
        names, first = cdr.decode_joint_state(raw[0])
    except LayoutError:
        notes.append(f"{topic} cannot be read and was ignored")
        return None
    try:
        ns, angle = cdr.decode_joint_positions(raw, names, first)
    except LayoutError:
        try:
            ns, angle = _one_by_one(raw, cdr.JOINT_STATE, lambda message: message.position, topic)
        except ValueError:
            notes.append(f"{topic} changes its axes on the way and was ignored")
            return None
    if not names or angle.ndim != 2 or angle.shape[1] != len(names):
        notes.append(f"{topic} has no angle for every axis and was ignored")
        return None
    _, chosen = np.unique(ns, return_index=True)
    return TableLog(seconds(ns[chosen], start_ns), names, angle[chosen])


def _kept(type_name: str) -> RawMessages:
    return ImuMessages() if type_name == cdr.IMU else RawMessages()


def _imu(raw: RawMessages, where: str, notes: list[str]) -> tuple[Stamps, Floats, Floats]:
    def one_by_one(messages: Sequence[bytes]) -> tuple[Stamps, Floats, Floats]:
        ns, values = _one_by_one(messages, cdr.IMU, _imu_values, where)
        return ns, values[:, :3], values[:, 3:]

    assert isinstance(raw, ImuMessages)
    samples = raw.samples(one_by_one)
    if raw.left_out:
        notes.append(f"{where}: {raw.left_out}")
    return samples


def _imu_values(message: Any) -> list[float]:
    rate, force = message.angular_velocity, message.linear_acceleration
    return [rate.x, rate.y, rate.z, force.x, force.y, force.z]


def _one_by_one(
    raw: Sequence[bytes], type_name: str, values: Callable[[Any], Any], where: str
) -> tuple[Stamps, Floats]:
    """Decode messages that share no layout; slow, and right for every encoding rosbags knows."""
    messages = [_message(data, type_name, f"{where}: message {k}") for k, data in enumerate(raw, 1)]
    stamps = np.array([stamp_ns(message) for message in messages], np.int64)
    return stamps, np.array([values(message) for message in messages], float)


def _message(raw: bytes, type_name: str, where: str) -> Any:
    try:
        return _typestore().deserialize_cdr(raw, type_name)
    except Exception as error:
        # rosbags answers damage with errors of its own, of struct, of numpy and of the decoder of text.
        raise DataError(f"{where} cannot be read: the bag is damaged ({error})") from error


@cache
def _typestore() -> Any:
    from rosbags.typesys import Stores, get_typestore  # noqa: PLC0415 (slow to load, and rarely needed)

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return get_typestore(Stores.ROS2_JAZZY)
