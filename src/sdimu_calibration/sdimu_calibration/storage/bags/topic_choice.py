"""Which topics of a bag are the test: as asked for, else the names of the project, else by the type of the messages."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from sdimu_calibration.core.plain_text import one_line
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.storage.bags import cdr
from sdimu_calibration.storage.bags.bag_file import TopicContent, absent, check_filled, check_type
from sdimu_calibration.storage.bags.raw_messages import RawMessages


@dataclass(frozen=True)
class Topics:
    """Topics of a recording."""

    imu: str = "/imu/data_raw"
    """sensor_msgs/Imu; the only one that must be there."""
    status: str = "/rate_table/status"
    """diagnostic_msgs/DiagnosticArray of the rate table."""
    joint_states: str = "/rate_table/joint_states"
    """sensor_msgs/JointState of the rate table."""
    temperature: str = "/imu/temperature"
    """sensor_msgs/Temperature of the IMU."""


_OWN = Topics()
KINDS = {"imu": cdr.IMU, "status": cdr.STATUS, "joint_states": cdr.JOINT_STATE, "temperature": cdr.TEMPERATURE}
"""Type of the messages of each topic of a test."""
_OPTION = {"imu": "--imu-topic", "status": "--status-topic"}
_LOOKED_AT = 200
"""Messages of a topic of diagnostics that are looked at for a phase."""
IsPhase = Callable[[bytes], bool]


@dataclass(frozen=True)
class TopicChoice:
    """Topics that the user asks for; None leaves the choice to the content of the bag."""

    imu: str | None = None
    status: str | None = None
    joint_states: str | None = None
    temperature: str | None = None


def choose(
    path: Path, content: Mapping[str, TopicContent], choice: TopicChoice, is_phase: IsPhase, notes: list[str]
) -> Topics:
    """Choose the topics.

    Parameters
    ----------
    path : Path
        For the messages to the user.
    is_phase : callable
        Whether a diagnostic message says ``dwell`` or ``rotating``.
    notes : list of str
        What was chosen by type is added.

    Returns
    -------
    Topics
        A topic that is not there keeps the project's name.
    """
    for kind in KINDS:
        asked = getattr(choice, kind)
        if asked is not None:
            _check(path, content, kind, asked)
    return Topics(**{kind: getattr(choice, kind) or _found(path, content, kind, is_phase, notes) for kind in KINDS})


def _check(path: Path, content: Mapping[str, TopicContent], kind: str, topic: str) -> None:
    types = {name: entry.type_name for name, entry in content.items()}
    if topic not in content:
        raise DataError(absent(path, types, topic, KINDS[kind]))
    check_type(path, topic, types[topic], {topic: KINDS[kind]})
    check_filled(path, topic, content[topic].raw)


def _found(path: Path, content: Mapping[str, TopicContent], kind: str, is_phase: IsPhase, notes: list[str]) -> str:
    """Find the topic of a kind by its own name, else by its type."""
    own = str(getattr(_OWN, kind))
    if own in content:
        check_type(path, own, content[own].type_name, {own: KINDS[kind]})
        if kind == "imu":
            check_filled(path, own, content[own].raw)
        return own
    candidates = [t for t, e in content.items() if e.type_name == KINDS[kind] and e.raw]
    if kind == "status":
        candidates = [t for t in candidates if any(map(is_phase, content[t].raw[:_LOOKED_AT]))]
    if kind == "imu" and not candidates:
        raise DataError(absent(path, {t: e.type_name for t, e in content.items()}, own, KINDS[kind]))
    if len(candidates) == 1:
        notes.append(one_line(f"{candidates[0]} is taken for {own}: the only topic of its kind"))
        return candidates[0]
    if candidates:
        listed = ", ".join(f"{t} ({_extent(content[t].raw)})" for t in sorted(candidates))
        if kind in _OPTION:
            raise DataError(f"{path}: which is the topic of the {kind}? {_OPTION[kind]} one of: {listed}")
        notes.append(one_line(f"several topics of {KINDS[kind]} and none was asked for; not used: {listed}"))
    return own


def _extent(raw: RawMessages) -> str:
    """Say how many messages there are, and their rate by header.stamp."""
    stamps = [cdr.stamp_of(message) if len(message) >= cdr.WITH_STAMP else 0 for message in raw.ends()]
    span = (stamps[1] - stamps[0]) * 1e-9
    rate = f", {(len(raw) - 1) / span:.4g} Hz" if span > 0.0 else ""
    return f"{len(raw)} messages{rate}"
