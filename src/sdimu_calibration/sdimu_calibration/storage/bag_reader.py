"""A bag read into a Recording, with everything that real recordings bring along."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from functools import cache, lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.data.arrival import arrange
from sdimu_calibration.core.recording import PhaseLog, Recording, TableLog, TemperatureLog, origin_ns
from sdimu_calibration.storage import cdr
from sdimu_calibration.storage.bag_file import raw_messages, read_topics
from sdimu_calibration.storage.cdr import LayoutError, Stamps
from sdimu_calibration.storage.raw_messages import RawMessages
from sdimu_calibration.storage.topic_choice import KINDS, TopicChoice, choose
from sdimu_calibration.storage.topics import Topics


def read_recording(path: Path, topics: Topics | TopicChoice | None = None) -> Recording:
    """Read a bag.

    Samples that are not finite and samples with a stamp that was there before are dropped and counted;
    samples out of order are sorted by stamp. What was mended is told in `notes`.

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

    Raises
    ------
    DataError
        When it is not a bag, has no IMU topic, or no usable sample; one line that says what to do.
    """
    path = Path(path)
    notes: list[str] = []
    topics, raw = _messages(path, topics, notes)
    ns, omega_ib_b, f_ib_b = _imu(raw[topics.imu])
    total = len(ns)
    arranged = arrange(ns, omega_ib_b, f_ib_b, f"{path}: {topics.imu}")
    notes.extend(arranged.notes)
    ns, omega_ib_b, f_ib_b = ns[arranged.rows], omega_ib_b[arranged.rows], f_ib_b[arranged.rows]
    start_ns = origin_ns(ns)
    return Recording(
        start_ns=start_ns,
        t=_seconds(ns, start_ns),
        omega_ib_b=omega_ib_b,
        f_ib_b=f_ib_b,
        phase=_phase(raw.get(topics.status, []), start_ns, topics.status, notes),
        temperature=_temperature(raw.get(topics.temperature, []), start_ns, topics.temperature, notes),
        table=_table(raw.get(topics.joint_states, []), start_ns, topics.joint_states, notes),
        rejected=total - len(ns),
        notes=tuple(notes),
    )


def _messages(
    path: Path, topics: Topics | TopicChoice | None, notes: list[str]
) -> tuple[Topics, dict[str, RawMessages]]:
    """Read the messages of the topics of the test."""
    if isinstance(topics, Topics):
        wanted = {getattr(topics, kind): type_name for kind, type_name in KINDS.items()}
        return topics, raw_messages(path, wanted, required=topics.imu)
    content = read_topics(path, lambda _, type_name: type_name in KINDS.values())
    chosen = choose(path, content, topics or TopicChoice(), _is_phase, notes)
    return chosen, {t: content[t].raw for t in vars(chosen).values() if t in content}


def _is_phase(raw: bytes) -> bool:
    return _phase_word(*_status_entry(raw)) in {"dwell", "rotating"}


def _phase_word(text: str, values: Mapping[str, str]) -> str:
    """Phase in a status, empty when there is none."""
    return (values.get("phase") or text).strip().lower()


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


def _phase(raw: Sequence[bytes], start_ns: int, topic: str, notes: list[str]) -> PhaseLog | None:
    """Phases in the order of their stamps; a message without a phase is ignored."""
    parsed = [entry for entry in map(_status, raw) if entry is not None]
    if len(parsed) < len(raw):
        notes.append(f"{len(raw) - len(parsed)} messages of {topic} had no phase and were ignored")
    if not parsed:
        return None
    ns = np.array([entry[0] for entry in parsed], np.int64)
    order = np.argsort(ns, kind="stable")
    dwell = np.array([entry[1] for entry in parsed])[order]
    counted = np.cumsum(dwell & ~np.concatenate([[False], dwell[:-1]])) - 1
    said = np.array([-1 if entry[2] is None else entry[2] for entry in parsed])[order]
    if (said < 0).any():
        notes.append(f"{topic} does not always say the stop: stops are counted from the dwells")
        said = np.maximum(counted, 0)
    return PhaseLog(_seconds(ns[order], start_ns), dwell, said.astype(np.int64))


def _status(raw: bytes) -> tuple[int, bool, int | None] | None:
    """Stamp (ns), True for dwell, stop; None without a phase. A phase of any other name is no dwell."""
    text, values = _status_entry(raw)
    phase = _phase_word(text, values)
    if not phase:
        return None
    stop = values.get("stop", "").strip()
    return cdr.stamp_of(raw), phase == "dwell", int(stop) if stop.isdecimal() else None


def _temperature(raw: Sequence[bytes], start_ns: int, topic: str, notes: list[str]) -> TemperatureLog | None:
    if not raw:
        return None
    try:
        ns, values = cdr.decode_doubles(raw, 2)
        value = values[:, 0]
    except LayoutError:
        ns, value = _one_by_one(raw, cdr.TEMPERATURE, lambda message: message.temperature)
    chosen = np.flatnonzero(np.isfinite(value))
    if len(chosen) < len(value):
        notes.append(f"{len(value) - len(chosen)} temperatures of {topic} were not finite and were dropped")
    chosen = chosen[np.unique(ns[chosen], return_index=True)[1]]
    return TemperatureLog(_seconds(ns[chosen], start_ns), value[chosen]) if len(chosen) else None


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
            ns, angle = _one_by_one(raw, cdr.JOINT_STATE, lambda message: message.position)
        except ValueError:
            notes.append(f"{topic} changes its axes on the way and was ignored")
            return None
    if angle.ndim != 2 or angle.shape[1] != len(names):
        notes.append(f"{topic} has no angle for every axis and was ignored")
        return None
    _, chosen = np.unique(ns, return_index=True)
    return TableLog(_seconds(ns[chosen], start_ns), names, angle[chosen])


def _imu(raw: Sequence[bytes]) -> tuple[Stamps, Floats, Floats]:
    try:
        return cdr.decode_imu(raw)
    except LayoutError:
        ns, values = _one_by_one(raw, cdr.IMU, _imu_values)
        return ns, values[:, :3], values[:, 3:]


def _imu_values(message: Any) -> list[float]:
    rate, force = message.angular_velocity, message.linear_acceleration
    return [rate.x, rate.y, rate.z, force.x, force.y, force.z]


def _one_by_one(raw: Sequence[bytes], type_name: str, values: Callable[[Any], Any]) -> tuple[Stamps, Floats]:
    """Decode messages that share no layout; slow, and right for every encoding rosbags knows."""
    messages = [_message(data, type_name) for data in raw]
    stamps = np.array([_stamp(message) for message in messages], np.int64)
    return stamps, np.array([values(message) for message in messages], float)


def _seconds(ns: Stamps, start_ns: int) -> Floats:
    return np.asarray((ns - start_ns) * 1e-9, np.float64)


def _stamp(message: Any) -> int:
    return int(message.header.stamp.sec) * 1_000_000_000 + int(message.header.stamp.nanosec)


def _message(raw: bytes, type_name: str) -> Any:
    return _typestore().deserialize_cdr(raw, type_name)


@cache
def _typestore() -> Any:
    from rosbags.typesys import Stores, get_typestore  # noqa: PLC0415 (slow to load, and rarely needed)

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return get_typestore(Stores.ROS2_JAZZY)
