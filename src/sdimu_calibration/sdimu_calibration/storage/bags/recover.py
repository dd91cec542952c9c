"""Mend a bag that was cut while it was being written: a kill, a full disk, a lost power supply."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from mcap.records import Schema

from sdimu_calibration.core.recording import DataError
from sdimu_calibration.storage.bags.bag_file import bag_parts, check_magic
from sdimu_calibration.storage.bags.bag_folder import DAMAGED_SUFFIX, held
from sdimu_calibration.storage.bags.bag_metadata import FileEntry, TopicEntry, custom_data, write_metadata
from sdimu_calibration.storage.bags.mcap_file import McapFile
from sdimu_calibration.storage.bags.mcap_walk import DamagedError, McapWalk
from sdimu_calibration.storage.files.whole_file import beside, free_beside, uninterrupted

_NO_SCHEMA = Schema(0, b"", "", "")
"""Of a channel whose schema is not in the file."""


@dataclass
class Salvage:
    """What one file gave."""

    path: Path
    damage: str = ""
    """What was wrong; empty for a whole file, which is left as it is."""
    kept: Path | None = None
    """Where the cut file is now."""
    counts: dict[str, int] = field(default_factory=dict)
    """Messages saved, by topic."""
    first_ns: int = 0
    last_ns: int = 0
    """`first_ns`, `last_ns`: first and last log time (ns) of the messages."""
    topics: dict[str, TopicEntry] = field(default_factory=dict)
    """For metadata.yaml."""


def recover(path: Path) -> tuple[Salvage, ...]:
    """Mend a bag in place: rewrite every cut file up to the cut, and make metadata.yaml anew.

    The cut file stays beside the mended one with ``.damaged`` at its name, and a number where that name is taken. A bag
    that is still being written is refused: its recorder would go on in the file that was set aside.

    Parameters
    ----------
    path : Path
        rosbag2 folder or .mcap file.

    Returns
    -------
    tuple of Salvage
        One a file.
    """
    parts = bag_parts(Path(path))
    for part in parts:
        if part.suffix != ".mcap":
            raise DataError(f"{part}: only MCAP files can be mended; unpack a packed one first (zstd -d FILE)")
        check_magic(part)
    folder = parts[0].parent
    with held(parts):
        salvages = tuple(_mend(part) for part in parts)
        if Path(path).is_dir() or (folder / "metadata.yaml").is_file():
            _rebuild_metadata(folder, salvages)
    return salvages


def _mend(part: Path) -> Salvage:
    """Rewrite one file, and put the copy in its place if it was damaged."""
    salvage = Salvage(part)
    copy = beside(part)
    try:
        with copy.open("wb") as stream:
            _copy(McapWalk(part), McapFile(stream), salvage)
        if salvage.damage and not any(salvage.counts.values()):
            raise DataError(f"{part}: no message is whole; nothing can be saved")
        if salvage.damage:
            with uninterrupted():
                kept = part.with_name(part.name + DAMAGED_SUFFIX)
                # One that was cut and mended before keeps its first cut file, too.
                salvage.kept = part.rename(free_beside(kept) if os.path.lexists(kept) else kept)
                copy.replace(part)
    finally:
        copy.unlink(missing_ok=True)
    return salvage


def _copy(walk: McapWalk, target: McapFile, salvage: Salvage) -> None:
    channels: dict[int, int] = {}
    try:
        for block in walk.blocks():
            for channel, time_ns, data in block:
                if channel not in channels:
                    channels[channel] = _copy_channel(walk, channel, target, salvage)
                target.message(channels[channel], data, time_ns)
                salvage.counts[walk.channels[channel].topic] += 1
    except DamagedError as error:
        salvage.damage = str(error)
    for channel in walk.channels.keys() - channels.keys():
        _copy_channel(walk, channel, target, salvage)
    target.finish()
    salvage.first_ns, salvage.last_ns = target.first_ns, target.last_ns


def _copy_channel(walk: McapWalk, channel: int, target: McapFile, salvage: Salvage) -> int:
    old = walk.channels[channel]
    schema = walk.schemas.get(old.schema_id, _NO_SCHEMA)
    salvage.counts.setdefault(old.topic, 0)
    qos = old.metadata.get("offered_qos_profiles", "")
    salvage.topics[old.topic] = TopicEntry(old.topic, schema.name, 0, old.metadata.get("topic_type_hash", ""), qos)
    number = target.schema(schema.name, schema.data, schema.encoding) if schema.name else 0
    return target.channel(old.topic, number, old.metadata)


def _rebuild_metadata(folder: Path, salvages: Sequence[Salvage]) -> None:
    files = [FileEntry(s.path.name, s.first_ns, s.last_ns, sum(s.counts.values())) for s in salvages]
    entries = {name: entry for salvage in salvages for name, entry in salvage.topics.items()}
    topics = [
        TopicEntry(
            entry.name,
            entry.type_name,
            sum(salvage.counts.get(name, 0) for salvage in salvages),
            entry.type_hash,
            entry.offered_qos,
        )
        for name, entry in entries.items()
    ]
    write_metadata(folder, files, topics, custom_data(folder))
