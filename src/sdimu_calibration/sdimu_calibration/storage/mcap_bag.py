"""A rosbag2 folder being written: one MCAP file and its metadata.yaml."""

from __future__ import annotations

import shutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType

import numpy as np

from sdimu_calibration.core.arrays import Ints
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.storage.bag_metadata import FileEntry, TopicEntry, write_metadata
from sdimu_calibration.storage.mcap_file import McapFile
from sdimu_calibration.storage.message_definition import definition, type_hash

# No profile: every player takes its defaults.
_OFFERED_QOS = "[]"


@dataclass
class _Topic:
    channel: int
    type_name: str
    count: int = 0


class McapBag:
    """Writer of one bag; messages are CDR bytes.

    A metadata.yaml is there from the start, so that a bag cut by a crash is still a folder that
    `sdimu bag recover` can mend; `close` writes the final one.

    Parameters
    ----------
    path : Path
        Folder to make.
    replace : bool
        Delete a bag that is already there.

    Raises
    ------
    DataError
        When the folder exists and is not to be replaced, or holds something else than a bag.
    """

    def __init__(self, path: Path, *, replace: bool = False) -> None:
        self.path = Path(path)
        _make_room(self.path, replace)
        self._file_name = f"{self.path.name}_0.mcap"
        self._topics: dict[str, _Topic] = {}
        self._schemas: dict[str, int] = {}
        self._first_ns: int | None = None
        self._last_ns = 0
        self._stream = (self.path / self._file_name).open("wb")
        self._writer = McapFile(self._stream)
        self._write_metadata()

    def topic(self, name: str, type_name: str) -> int:
        """Announce a topic; announcing it again with the same type does nothing.

        Parameters
        ----------
        name, type_name : str
            Such as ``/imu/data_raw`` and ``sensor_msgs/msg/Imu``.

        Returns
        -------
        int
            MCAP channel.

        Raises
        ------
        DataError
            When the type is not installed, or the topic is already there with another type.
        """
        known = self._topics.get(name)
        if known is not None:
            if known.type_name != type_name:
                raise DataError(f"topic {name} is already in the bag as {known.type_name}, not {type_name}")
            return known.channel
        if type_name not in self._schemas:
            self._schemas[type_name] = self._writer.schema(type_name, definition(type_name).encode())
        metadata = {"offered_qos_profiles": _OFFERED_QOS, "topic_type_hash": type_hash(type_name)}
        channel = self._writer.channel(name, self._schemas[type_name], metadata)
        self._topics[name] = _Topic(channel, type_name)
        self._write_metadata()
        return channel

    def write(self, name: str, data: bytes, log_time_ns: int) -> None:
        """Append a message.

        Parameters
        ----------
        name : str
            An announced topic.
        data : bytes
            The message in CDR, with its 4-byte encapsulation header.
        log_time_ns : int
            Time (ns) under which it is filed: the stamp in its header, where it has one.
        """
        topic = self._topics[name]
        self._writer.message(topic.channel, data, log_time_ns)
        topic.count += 1
        if self._first_ns is None or log_time_ns < self._first_ns:
            self._first_ns = log_time_ns
        self._last_ns = max(self._last_ns, log_time_ns)

    def write_merged(self, streams: Mapping[str, tuple[Ints, Sequence[bytes]]]) -> None:
        """Append messages of several topics in the order of their times.

        Parameters
        ----------
        streams : dict of str to (ndarray of int, shape (n,), sequence of bytes, length n)
            Times (ns) and messages (CDR) of each topic; at the same time the first topic goes first.
        """
        times = [np.asarray(ns, np.int64) for ns, _ in streams.values()]
        numbers = [self._topics[name].channel for name in streams]
        data = [message for _, messages in streams.values() for message in messages]
        if not data:
            return
        ns, channel = np.concatenate(times), np.repeat(numbers, [len(each) for each in times])
        order = np.argsort(ns, kind="stable")
        self._writer.messages(channel[order], [data[k] for k in order.tolist()], ns[order])
        for name, each in zip(streams, times, strict=True):
            self._topics[name].count += len(each)
        self._first_ns = int(ns.min()) if self._first_ns is None else min(self._first_ns, int(ns.min()))
        self._last_ns = max(self._last_ns, int(ns.max()))

    def flush(self) -> None:
        """Close the chunk and hand it to the system: what was written until now survives a kill."""
        self._writer.flush()

    def close(self) -> None:
        """Finish the file and write the final metadata.yaml; a second call does nothing."""
        if self._stream.closed:
            return
        self._writer.finish()
        self._stream.close()
        self._write_metadata()

    def __enter__(self) -> McapBag:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    @property
    def counts(self) -> dict[str, int]:
        """Messages written so far, by topic."""
        return {name: topic.count for name, topic in self._topics.items()}

    def _write_metadata(self) -> None:
        count = sum(topic.count for topic in self._topics.values())
        file = FileEntry(self._file_name, self._first_ns or 0, self._last_ns, count)
        topics = [
            TopicEntry(name, topic.type_name, topic.count, type_hash(topic.type_name), _OFFERED_QOS)
            for name, topic in self._topics.items()
        ]
        write_metadata(self.path, [file], topics)


def _make_room(path: Path, replace: bool) -> None:
    """Make the folder; an old bag goes only when asked to, anything else never."""
    if path.is_dir() and any(path.iterdir()):
        if not (path / "metadata.yaml").is_file():
            raise DataError(f"{path}: the folder is not empty and not a bag; choose another one")
        if not replace:
            raise DataError(f"{path}: a bag is already there; --replace replaces it, or choose another folder")
        shutil.rmtree(path)
    try:
        path.mkdir(parents=True, exist_ok=True)
    except (FileExistsError, NotADirectoryError) as error:
        raise DataError(f"{path}: a file is in the way of the bag folder; choose another one") from error
