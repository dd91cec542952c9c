"""What is in a bag, at a glance."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from rosbags.rosbag1 import Reader as Reader1
from rosbags.rosbag2 import Reader

from sdimu_calibration.core.recording import DataError
from sdimu_calibration.storage.bags.bag_file import ROS1, check_magic, unpacked_parts
from sdimu_calibration.storage.bags.mcap_walk import DamagedError, McapWalk


@dataclass
class BagInfo:
    """Content of a bag."""

    types: dict[str, str] = field(default_factory=dict)
    """Type by topic."""
    counts: dict[str, int] = field(default_factory=dict)
    """Messages by topic."""
    first_ns: int = 0
    last_ns: int = 0
    """`first_ns`, `last_ns`: first and last log time (ns); 0 without messages."""
    damaged: list[Path] = field(default_factory=list)
    """Files that end before their footer; the bag itself where they are packed in it."""

    def extend(self, first_ns: int, last_ns: int) -> None:
        """Take in a span of log time."""
        self.first_ns = min(first_ns, self.first_ns) if self.first_ns else first_ns
        self.last_ns = max(last_ns, self.last_ns)


def read_info(path: Path) -> BagInfo:
    """Count what is in a bag, damaged or not."""
    info, path = BagInfo(), Path(path)
    if path.is_file() and path.suffix == ROS1:
        # Its counts are there without the conversion that a reader of messages makes.
        _add_other(path, info, Reader1)
        return info
    with unpacked_parts(path) as (parts, _):
        for part in parts:
            if part.suffix == ".mcap":
                _add_mcap(part, path, info)
            else:
                _add_other(part, info, Reader)
    return info


def _add_mcap(part: Path, bag: Path, info: BagInfo) -> None:
    check_magic(part)
    walk = McapWalk(part)
    counts: dict[int, int] = {}
    try:
        for block in walk.blocks():
            if block:
                times = [time_ns for _, time_ns, _ in block]
                info.extend(min(times), max(times))
            for channel, _, _ in block:
                counts[channel] = counts.get(channel, 0) + 1
    except DamagedError:
        info.damaged.append(part if bag in {part.parent, part} else bag)
    for key, channel in walk.channels.items():
        info.types[channel.topic] = walk.type_name(key)
        info.counts[channel.topic] = info.counts.get(channel.topic, 0) + counts.get(key, 0)


def _add_other(part: Path, info: BagInfo, kind: type[Reader] | type[Reader1]) -> None:
    try:
        with kind(part) as reader:
            if reader.message_count:
                info.extend(reader.start_time, reader.end_time - 1)
            for connection in reader.connections:
                info.types[connection.topic] = connection.msgtype
                info.counts[connection.topic] = info.counts.get(connection.topic, 0) + connection.msgcount
    except Exception as error:
        # rosbags answers damage with errors of its own, of sqlite, of zstd and of struct.
        raise DataError(f"{part}: the bag cannot be read ({error})") from error
