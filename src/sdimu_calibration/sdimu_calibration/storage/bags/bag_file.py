"""Raw messages of a bag, whatever holds them: rosbag2 folder, bare MCAP, SQLite; compressed or not; ROS 1."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from sdimu_calibration.core.recording import DataError
from sdimu_calibration.shell_words import joined
from sdimu_calibration.storage.bags.bag_metadata import named_files, read_metadata
from sdimu_calibration.storage.bags.mcap_walk import MAGIC, DamagedError, McapWalk, Messages
from sdimu_calibration.storage.bags.own_process import run
from sdimu_calibration.storage.bags.raw_messages import Block, RawMessages
from sdimu_calibration.storage.bags.unpacking import Allowance, UnpackError, allowed, unpack_file
from sdimu_calibration.storage.files.bounded_file import check_regular

ROS1 = ".bag"
_PACKED = ".zstd"
BAG_SUFFIXES = (".mcap", ".db3", _PACKED, ROS1)
"""Endings of files that hold messages."""
_ZSTD = "zstd"
_CONVERTER = Path(__file__).with_name("ros1_converter.py")
_PATIENCE_S = 3600.0
"""Time (s) that the conversion of a bag of ROS 1 may take: a gigabyte takes minutes."""
Unpack = Callable[[bytes], bytes]


@dataclass
class TopicContent:
    """Type of a topic (such as ``sensor_msgs/msg/Imu``), and its messages (CDR bytes) in the order of the bag."""

    type_name: str
    raw: RawMessages = field(default_factory=RawMessages)


Takes = Callable[[str, str], bool]
"""Whether the messages of a topic (name, type) are wanted."""
Keep = Callable[[str], RawMessages]
"""What the messages of a topic of some type go into."""
TargetOf = Callable[[str, str], RawMessages | None]
"""Where the messages of a topic (name, type) go; None when they are not wanted."""


def raw_messages(
    path: Path, wanted: Mapping[str, str], required: str, kept: Keep = lambda _: RawMessages()
) -> dict[str, RawMessages]:
    """Read the CDR bytes of the messages of some topics.

    Parameters
    ----------
    path : Path
        Folder or file.
    wanted : mapping of str to str
        Type (such as ``sensor_msgs/msg/Imu``) by topic. A topic that is absent is left out of the answer,
        unless it is `required`.
    required : str
        The topic that must be there with at least one message.
    kept : callable
        Makes what the messages of a topic go into, from its type.

    Returns
    -------
    dict of str to RawMessages
        Messages in the order of the bag.
    """

    def takes(topic: str, type_name: str) -> bool:
        check_type(path, topic, type_name, wanted)
        return topic in wanted

    found = read_topics(path, takes, kept)
    if required not in found:
        raise DataError(absent(path, {t: c.type_name for t, c in found.items()}, required, wanted[required]))
    check_filled(path, required, found[required].raw)
    return {topic: found[topic].raw for topic in wanted if topic in found}


def check_filled(path: Path, topic: str, raw: RawMessages) -> None:
    """Raise DataError when a topic has no messages."""
    if not raw:
        raise DataError(f"{path}: topic {topic} has no messages; record the bag while the IMU is running")


def read_topics(path: Path, takes: Takes, kept: Keep = lambda _: RawMessages()) -> dict[str, TopicContent]:
    """Read the messages of the topics that are wanted; the others come without messages.

    Parameters
    ----------
    path : Path
        rosbag2 folder, .mcap or .db3 file (packed by zstd or not), ROS 1 bag.
    takes : callable
        Asked with name and type of every topic.
    kept : callable
        Makes what the messages of a topic go into, from its type.
    """
    content: dict[str, TopicContent] = {}

    def target(topic: str, type_name: str) -> RawMessages | None:
        """Where the messages of a topic go; None when they are not wanted."""
        wanted = takes(topic, type_name)
        entry = content.setdefault(topic, TopicContent(type_name, kept(type_name)))
        return entry.raw if wanted else None

    with unpacked_parts(path) as (parts, unpack):
        for part in parts:
            if part.suffix == ".mcap":
                _read_mcap(part, path, target, unpack, content)
            else:
                _read_with_rosbags(part, path, target, unpack, content)
    return content


@contextmanager
def unpacked_parts(path: Path) -> Iterator[tuple[list[Path], Unpack | None]]:
    """Yield files that the readers below can open, and how each message is packed in them; None when not at all.

    Those that were packed as files are there while the context lasts.
    """
    parts = bag_parts(path)
    information = read_metadata(path) if path.is_dir() else {}
    mode = _mode(information)
    if mode and information.get("compression_format") != _ZSTD:
        raise DataError(f"{path}: compressed by {information.get('compression_format')}, which cannot be read")
    if mode:
        # Unpacked here, within bounds: the reader of folders knows none.
        parts = _present(_named(path, information))
    if mode == "message":
        yield parts, partial(Allowance(allowed(path)).unpack, _ZSTD)
        return
    if not any(part.suffix in {_PACKED, ROS1} for part in parts):
        yield parts, None
        return
    with TemporaryDirectory(prefix="sdimu-") as folder:
        yield [_opened(part, Path(folder)) for part in parts], None


def _opened(part: Path, folder: Path) -> Path:
    """Unpack a file into `folder`; another file stays where it is."""
    if part.suffix == ROS1:
        return _from_ros1(part, folder / part.stem)
    if part.suffix != _PACKED:
        return part
    target = folder / part.stem
    try:
        unpack_file(part, target)
    except UnpackError as error:
        raise DataError(f"{part}: cannot be unpacked ({error})") from error
    return target


def _from_ros1(part: Path, target: Path) -> Path:
    """Convert a bag of ROS 1 to one of ROS 2."""
    run(_CONVERTER, part, target, allowed(part), _PATIENCE_S, "the bag cannot be read")
    if not target.is_dir():
        raise DataError(f"{part}: no topic of sensor_msgs/Imu in the bag")
    return target


def bag_parts(path: Path) -> list[Path]:
    """Things to open, in order: the files of a folder, or the folder itself where its metadata is needed.

    MCAP files say all that is needed themselves. They are opened directly because a metadata.yaml that is
    missing or does not repeat their QoS exactly makes folder readers fail or, worse, yield nothing.
    """
    if not path.exists():
        raise DataError(f"{path}: no such file or folder")
    if not path.is_dir():
        check_regular(path)
        if path.suffix not in BAG_SUFFIXES:
            raise DataError(
                f"{path}: not a bag (expected a rosbag2 folder, an .mcap or .db3 file, or a ROS 1 .bag; sdimu import "
                "makes one of columns in text, MAT and NPZ files)"
            )
        return [path]
    information = read_metadata(path)
    if _mode(information) or information.get("storage_identifier") == "sqlite3":
        return [path]
    named = _named(path, information)
    files = [file for file in named if file.is_file()] or sorted(path.glob("*.mcap"))
    if len(named) > len(files):
        _present(named)
    if not files:
        listed = "a metadata.yaml that names no file" if information else "no metadata.yaml"
        raise DataError(f"{path}: not a bag ({listed}, and no .mcap file in the folder)")
    return files


def _mode(information: Mapping[str, Any]) -> str:
    """How a bag is packed: ``file``, ``message``, or nothing; "none" and "" mean the same."""
    mode = information.get("compression_mode")
    return mode.lower() if isinstance(mode, str) and mode.lower() in {"file", "message"} else ""


def _named(folder: Path, information: Mapping[str, Any]) -> list[Path]:
    return [folder / name for name in named_files(information)]


def _present(named: list[Path]) -> list[Path]:
    gone = next((file for file in named if not file.is_file()), None)
    if gone is not None:
        raise DataError(f"{gone}: file is missing though the bag's metadata.yaml names it")
    return named


def _read_mcap(
    part: Path, bag: Path, target_of: TargetOf, unpack: Unpack | None, content: dict[str, TopicContent]
) -> None:
    check_magic(part)
    walk = McapWalk(part, allowed(bag))
    targets: dict[int, RawMessages | None] = {}
    try:
        for block in walk.blocks():
            for channel in walk.channels.keys() - targets.keys():
                targets[channel] = target_of(walk.channels[channel].topic, walk.type_name(channel))
            for channel in block.channels():
                target = targets[channel]
                if target is not None:
                    _take(block, channel, unpack, target)
    except DamagedError as error:
        if bag not in {part.parent, part}:
            raise DataError(f"{bag}: a file in it is cut short or damaged ({error})") from error
        mend = joined(["sdimu", "bag", "recover", str(part)])
        raise DataError(f"{part}: the file is cut short or damaged ({error}); run: {mend}") from error
    except UnpackError as error:
        raise DataError(f"{bag}: a message cannot be unpacked ({error})") from error
    for key, channel in walk.channels.items():
        # Topics that never had a message are not in any chunk that has one.
        content.setdefault(channel.topic, TopicContent(walk.type_name(key)))


def _take(block: Messages, channel: int, unpack: Unpack | None, target: RawMessages) -> None:
    """Append the messages of a channel; each is unpacked where they are packed one by one."""
    rows = block.channel == channel
    messages = Block(block.content, block.start[rows], block.length[rows])
    if unpack is None:
        target.extend(messages)
        return
    for message in messages:
        target.append(unpack(message))


def check_magic(part: Path) -> None:
    """Raise DataError unless the file begins as an MCAP file."""
    check_regular(part)
    with part.open("rb") as stream:
        magic = stream.read(len(MAGIC))
    if not magic:
        raise DataError(f"{part}: the file is empty")
    if magic != MAGIC:
        raise DataError(f"{part}: not an MCAP file")


def _read_with_rosbags(
    part: Path, bag: Path, target_of: TargetOf, unpack: Unpack | None, content: dict[str, TopicContent]
) -> None:
    from rosbags.rosbag2 import Reader  # noqa: PLC0415 (slow to load, and most bags are MCAP)

    try:
        with Reader(part) as reader:
            targets = {c.topic: target_of(c.topic, c.msgtype) for c in reader.connections}
            chosen = [c for c in reader.connections if targets[c.topic] is not None]
            for connection, _, raw in reader.messages(chosen) if chosen else ():
                if not isinstance(raw, bytes | memoryview):
                    raise DataError(f"{bag}: a message of {connection.topic} is no bytes: the bag is damaged")
                content[connection.topic].raw.append(bytes(raw) if unpack is None else unpack(bytes(raw)))
    except (DataError, PermissionError):
        raise
    except Exception as error:
        # rosbags answers damage with errors of its own, of sqlite, of zstd and of struct.
        raise DataError(f"{bag}: the bag cannot be read ({_line(error)})") from error


def check_type(path: Path, topic: str, type_name: str, wanted: Mapping[str, str]) -> None:
    """Raise DataError when a topic that is wanted has another type."""
    if topic in wanted and type_name != wanted[topic]:
        raise DataError(f"{path}: topic {topic} is {type_name or 'of no type'}, expected {wanted[topic]}")


def absent(path: Path, types: Mapping[str, str], required: str, type_name: str) -> str:
    """Say that a topic is not there, and what is."""
    others = sorted(topic for topic, other in types.items() if other == type_name)
    if not types:
        return f"{path}: the bag is empty; record it while the IMU is running"
    there = f"topics of that type are {', '.join(others)}" if others else "no topic of that type is there"
    return f"{path}: no topic {required} ({type_name}); {there}"


def _line(error: Exception) -> str:
    return (str(error).splitlines() or [type(error).__name__])[0]
