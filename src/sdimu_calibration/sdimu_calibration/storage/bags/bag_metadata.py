"""The metadata.yaml of a rosbag2 folder (version 9)."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from sdimu_calibration.storage.files.bounded_file import read_text
from sdimu_calibration.storage.files.whole_file import write_whole

METADATA = "metadata.yaml"
LONGEST_METADATA = 1 << 24
"""Bytes of the metadata of a bag at most: a topic takes some hundred."""
_ALIAS = re.compile(r"[&*]\w")
_LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
"""Ten times as fast as the loader in Python where PyYAML has it; both read the same."""
_WORDS = getattr(yaml, "CBaseLoader", yaml.BaseLoader)
"""Reads every value as the text that it is."""


@dataclass(frozen=True)
class TopicEntry:
    """A topic: name, type, number of messages, hash of the type, QoS as the YAML text of its MCAP channel."""

    name: str
    type_name: str
    count: int
    type_hash: str
    offered_qos: str


@dataclass(frozen=True)
class FileEntry:
    """A file of the bag: its name, first and last log time (ns), number of messages."""

    name: str
    first_ns: int
    last_ns: int
    count: int


def write_metadata(
    folder: Path, files: Sequence[FileEntry], topics: Sequence[TopicEntry], custom: Mapping[str, str] | None = None
) -> None:
    """Write metadata.yaml into `folder`, whole or not at all.

    Parameters
    ----------
    files : sequence of FileEntry
        In the order in which they are to be read.
    custom : mapping of str to str, optional
        What the user says of the recording.
    """
    filled = [file for file in files if file.count] or list(files)
    whole = FileEntry("", min(f.first_ns for f in filled), max(f.last_ns for f in filled), sum(f.count for f in files))
    content = {
        "version": 9,
        "storage_identifier": "mcap",
        "relative_file_paths": [file.name for file in files],
        **_span(whole),
        "topics_with_message_count": [_topic(topic) for topic in topics],
        "compression_format": "",
        "compression_mode": "",
        "files": [{"path": file.name, **_span(file)} for file in files],
        "custom_data": dict(custom) if custom else None,
        "ros_distro": "jazzy",
    }
    text = yaml.dump({"rosbag2_bagfile_information": content}, Dumper=_PlainDumper, sort_keys=False)
    write_whole(folder / METADATA, text)


def read_metadata(folder: Path, loader: Any = _LOADER) -> Mapping[str, Any]:
    """Content of metadata.yaml, empty when there is none or it cannot be used."""
    try:
        content = yaml.load(read_text(folder / METADATA, LONGEST_METADATA), Loader=loader)
        information = content["rosbag2_bagfile_information"]
    except Exception:
        # PyYAML answers damage with errors of its own, of int(), of datetime and of the stack.
        return {}
    return information if isinstance(information, dict) else {}


def custom_data(path: Path) -> dict[str, str]:
    """Return what the user said of a recording when it was made; empty where nothing is said or `path` is no folder."""
    # As words: rosbag2 writes a serial number 007 without quotes.
    said = read_metadata(path, _WORDS).get("custom_data") if path.is_dir() else None
    return {str(key): value for key, value in said.items() if isinstance(value, str)} if isinstance(said, dict) else {}


def named_files(information: Mapping[str, Any]) -> list[str]:
    """Names of the files of a bag, without folders, as its metadata gives them."""
    listed = information.get("relative_file_paths")
    return [Path(name).name for name in listed if isinstance(name, str)] if isinstance(listed, list) else []


class _PlainDumper(getattr(yaml, "CSafeDumper", yaml.SafeDumper)):  # type: ignore[misc]
    """YAML without anchors: other readers of bags need not know them.

    In C where PyYAML has it: a recorder writes its metadata anew for each topic.
    """

    def ignore_aliases(self, data: Any) -> bool:  # noqa: ARG002 (the name is the base class')
        return True


def _span(file: FileEntry) -> dict[str, Any]:
    return {
        "duration": {"nanoseconds": max(0, file.last_ns - file.first_ns)},
        "starting_time": {"nanoseconds_since_epoch": file.first_ns},
        "message_count": file.count,
    }


def _topic(topic: TopicEntry) -> dict[str, Any]:
    # rosbags compares the QoS of the MCAP channel with the one here and yields no message, and no error,
    # when they differ: this one is parsed from the channel's.
    return {
        "topic_metadata": {
            "name": topic.name,
            "type": topic.type_name,
            "serialization_format": "cdr",
            "offered_qos_profiles": _qos(topic.offered_qos),
            "type_description_hash": topic.type_hash,
        },
        "message_count": topic.count,
    }


def _qos(text: str) -> list[Any]:
    """QoS of a channel as a list; none where the channel says nothing that can be read."""
    try:
        found = yaml.load(text, Loader=_LOADER)
    except Exception:
        # As for the metadata: the text comes from a file that may be damaged.
        return []
    # A nesting of aliases is short as text and endless when it is written out.
    return found if isinstance(found, list) and not _ALIAS.search(text) else []
