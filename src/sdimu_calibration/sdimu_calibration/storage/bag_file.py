"""Raw messages of a bag, whatever holds them: rosbag2 folder, bare MCAP, SQLite."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml
from rosbags.rosbag2 import Reader

from sdimu_calibration.core.recording import DataError
from sdimu_calibration.storage.mcap_walk import MAGIC, DamagedError, McapWalk

_SUFFIXES = (".mcap", ".db3")


def raw_messages(path: Path, wanted: Mapping[str, str], required: str) -> dict[str, list[bytes]]:
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

    Returns
    -------
    dict of str to list of bytes
        Messages in the order of the bag.

    Raises
    ------
    DataError
        When the bag cannot be read, a topic has another type, or the required topic is not there.
    """
    found: dict[str, list[bytes]] = {topic: [] for topic in wanted}
    types: dict[str, str] = {}
    for part in bag_parts(path):
        read = _read_mcap if part.suffix == ".mcap" else _read_with_rosbags
        read(part, wanted, types, found)
    if required not in types:
        raise DataError(_absent(path, types, required, wanted[required]))
    if not found[required]:
        raise DataError(f"{path}: topic {required} has no messages; record the bag while the IMU is running")
    return {topic: messages for topic, messages in found.items() if topic in types}


def bag_parts(path: Path) -> list[Path]:
    """Things to open, in order: the files of a folder, or the folder itself where its metadata is needed.

    MCAP files say all that is needed themselves. They are opened directly because a metadata.yaml that is
    missing or does not repeat their QoS exactly makes folder readers fail or, worse, yield nothing.

    Raises
    ------
    DataError
        When there is nothing of a bag at `path`.
    """
    if not path.exists():
        raise DataError(f"{path}: no such file or folder")
    if path.is_file():
        if path.suffix not in _SUFFIXES:
            raise DataError(f"{path}: not a bag (expected a rosbag2 folder or a .mcap file)")
        return [path]
    information = _metadata(path)
    if information.get("compression_mode") or information.get("storage_identifier") == "sqlite3":
        return [path]
    named = [path / Path(str(name)).name for name in information.get("relative_file_paths", [])]
    files = [file for file in named if file.is_file()] or sorted(path.glob("*.mcap"))
    if len(named) > len(files):
        absent = next(file for file in named if not file.is_file())
        raise DataError(f"{absent}: file is missing though the bag's metadata.yaml names it")
    if not files:
        raise DataError(f"{path}: not a bag (no metadata.yaml and no .mcap file in the folder)")
    return files


def _metadata(folder: Path) -> Mapping[str, Any]:
    """Content of metadata.yaml, empty when there is none or it cannot be used."""
    try:
        content = yaml.safe_load((folder / "metadata.yaml").read_text(encoding="utf-8"))
        information = content["rosbag2_bagfile_information"]
    except (FileNotFoundError, UnicodeDecodeError, yaml.YAMLError, TypeError, KeyError):
        return {}
    return information if isinstance(information, dict) else {}


def _read_mcap(part: Path, wanted: Mapping[str, str], types: dict[str, str], found: dict[str, list[bytes]]) -> None:
    check_magic(part)
    walk = McapWalk(part)
    targets: dict[int, list[bytes] | None] = {}
    try:
        for block in walk.blocks():
            for channel in walk.channels.keys() - targets.keys():
                topic = walk.channels[channel].topic
                _check_type(part, topic, walk.type_name(channel), wanted)
                types[topic] = walk.type_name(channel)
                targets[channel] = found.get(topic)
            for channel, _, raw in block:
                target = targets[channel]
                if target is not None:
                    target.append(raw)
    except DamagedError as error:
        raise DataError(f"{part}: the file is cut short or damaged; run: sdimu bag recover {part}") from error
    # Topics that never had a message are not in any chunk that has one.
    types.update((channel.topic, walk.type_name(key)) for key, channel in walk.channels.items())


def check_magic(part: Path) -> None:
    """Raise DataError unless the file begins as an MCAP file."""
    with part.open("rb") as stream:
        magic = stream.read(len(MAGIC))
    if not magic:
        raise DataError(f"{part}: the file is empty")
    if magic != MAGIC:
        raise DataError(f"{part}: not an MCAP file")


def _read_with_rosbags(
    part: Path, wanted: Mapping[str, str], types: dict[str, str], found: dict[str, list[bytes]]
) -> None:
    try:
        with Reader(part) as reader:
            types.update((connection.topic, connection.msgtype) for connection in reader.connections)
            for topic, type_name in types.items():
                _check_type(part, topic, type_name, wanted)
            chosen = [connection for connection in reader.connections if connection.topic in wanted]
            for connection, _, raw in reader.messages(chosen) if chosen else ():
                found[connection.topic].append(raw)
    except (DataError, PermissionError):
        raise
    except Exception as error:
        # rosbags answers damage with errors of its own, of sqlite, of zstd and of struct.
        raise DataError(f"{part}: the bag cannot be read ({_line(error)})") from error


def _check_type(path: Path, topic: str, type_name: str, wanted: Mapping[str, str]) -> None:
    if topic in wanted and type_name != wanted[topic]:
        raise DataError(f"{path}: topic {topic} is {type_name or 'of no type'}, expected {wanted[topic]}")


def _absent(path: Path, types: Mapping[str, str], required: str, type_name: str) -> str:
    others = sorted(topic for topic, other in types.items() if other == type_name)
    if not types:
        return f"{path}: the bag is empty; record it while the IMU is running"
    there = f"topics of that type are {', '.join(others)}" if others else "no topic of that type is there"
    return f"{path}: no topic {required} ({type_name}); {there}"


def _line(error: Exception) -> str:
    return (str(error).splitlines() or [type(error).__name__])[0]
