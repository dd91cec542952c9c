"""A rosbag2 folder being written: one MCAP file and its metadata.yaml."""

from __future__ import annotations

import shutil
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType

import numpy as np

from sdimu_calibration.core.arrays import Ints
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.storage.bags.bag_folder import check_room, hold, put_in_place
from sdimu_calibration.storage.bags.bag_metadata import FileEntry, TopicEntry, write_metadata
from sdimu_calibration.storage.bags.mcap_file import McapFile
from sdimu_calibration.storage.bags.message_definition import definition, type_hash
from sdimu_calibration.storage.files.whole_file import beside, missing_folders, remove_empty

# No profile: every player takes its defaults.
_OFFERED_QOS = "[]"


@dataclass
class _Topic:
    channel: int
    type_name: str
    count: int = 0


class McapBag:
    """Writer of one bag; messages are CDR bytes.

    A bag is written beside its place and put there by `close`: a part of one never looks whole. As a context, an
    exception leaves nothing, and what was in its place stays. A live recording is written in its place instead, with
    a metadata.yaml from the start: cut by a crash it is still a folder that `sdimu bag recover` can mend.

    Parameters
    ----------
    path : Path
        Folder to make.
    replace : bool
        Delete a bag that is already there.
    live : bool
        Write in place.
    custom : mapping of str to str, optional
        What the user says of the recording, for its metadata.
    """

    def __init__(
        self, path: Path, *, replace: bool = False, live: bool = False, custom: Mapping[str, str] | None = None
    ) -> None:
        self.path = Path(path)
        check_room(self.path, replace)
        self._replace = replace
        self._custom = custom
        self._folder = beside(self.path)
        self._made = missing_folders(self.path.parent)
        self._file_name = f"{self.path.name}_0.mcap"
        self._topics: dict[str, _Topic] = {}
        self._schemas: dict[str, int] = {}
        self._first_ns: int | None = None
        self._last_ns = 0
        self._failed = False
        try:
            with self._told():
                self._folder.mkdir(parents=True)
                if live:
                    put_in_place(self._folder, self.path, replace)
                    self._folder = self.path
                self._stream = (self._folder / self._file_name).open("wb")
                hold(self._stream)
        except BaseException:
            self._remove()
            raise
        try:
            with self._told():
                self._writer = McapFile(self._stream)
            self._write_metadata()
        except BaseException:
            self.abandon()
            raise

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
            Time (ns) under which it is filed: the stamp in its header, where it has one; 0 for one before 1970, which
            the format cannot say.
        """
        topic, log_time_ns = self._topics[name], max(log_time_ns, 0)
        with self._told():
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
            Times (ns) and messages (CDR) of each topic, filed as by `write`; at the same time the first topic goes
            first.
        """
        times = [np.asarray(ns, np.int64) for ns, _ in streams.values()]
        numbers = [self._topics[name].channel for name in streams]
        data = [message for _, messages in streams.values() for message in messages]
        if not data:
            return
        ns, channel = np.concatenate(times), np.repeat(numbers, [len(each) for each in times])
        order = np.argsort(ns, kind="stable")
        ns = np.maximum(ns, 0)
        with self._told():
            self._writer.messages(channel[order], [data[k] for k in order.tolist()], ns[order])
        for name, each in zip(streams, times, strict=True):
            self._topics[name].count += len(each)
        self._first_ns = int(ns.min()) if self._first_ns is None else min(self._first_ns, int(ns.min()))
        self._last_ns = max(self._last_ns, int(ns.max()))

    def flush(self) -> None:
        """Close the chunk and hand it to the system: what was written until now survives a kill."""
        with self._told():
            self._writer.flush()

    def close(self) -> None:
        """Finish the bag and put it in its place; a second call does nothing.

        A live bag that the system has refused to write stays as it is: what came before can be mended.
        """
        if self._stream.closed:
            return
        if self._failed:
            self.abandon()
            return
        with self._told():
            try:
                self._writer.finish()
            finally:
                self._stream.close()
        self._write_metadata()
        with self._told():
            if self._folder != self.path:
                put_in_place(self._folder, self.path, self._replace)

    def abandon(self) -> None:
        """Leave nothing of the bag; a live one stays as it is, cut."""
        with suppress(OSError):
            self._stream.close()
        self._remove()

    def _remove(self) -> None:
        """Take away what is not in its place, and folders that were made for it."""
        if self._folder != self.path:
            shutil.rmtree(self._folder, ignore_errors=True)
            remove_empty(self._made)

    def __enter__(self) -> McapBag:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            if kind is None:
                self.close()
        finally:
            self.abandon()

    @contextmanager
    def _told(self) -> Iterator[None]:
        """Say which bag it is that the system refuses to write."""
        try:
            yield
        except OSError as error:
            self._failed = True
            live = "; what came before can be mended: sdimu bag recover" if self._folder == self.path else ""
            raise DataError(f"{self.path}: the bag cannot be written ({error.strerror or error}){live}") from error

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
        with self._told():
            write_metadata(self._folder, [file], topics, self._custom)
