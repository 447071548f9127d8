"""A recording of ROS: its topics, the stamps of their messages, and any message by its stamp."""

from __future__ import annotations

import struct
import threading
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import InputError, UserError
from ..extras import install_command

if TYPE_CHECKING:
    from rosbags.highlevel import AnyReader

SUFFIXES = (".bag", ".mcap", ".db3")
METADATA = "metadata.yaml"  # makes a folder a recording of ROS 2, where this is in it:
METADATA_KEY = b"rosbag2_bagfile_information"
NANO = 1_000_000_000  # ns in a second


class BadMessage(Exception):
    """A message that cannot be read; the text says why."""


@dataclass(frozen=True, slots=True)
class Topic:
    """One topic of a bag.

    Attributes:
        name: with its leading slash.
        type: such as `sensor_msgs/msg/Image`, of ROS 1 and 2 alike; "several types" where publishers disagree.
        count: messages.
    """

    name: str
    type: str
    count: int

    def __str__(self) -> str:
        return f"{self.name} ({self.type}, {self.count})"


@dataclass(frozen=True, slots=True, eq=False)
class MessageIndex:
    """Where a topic's messages are, sorted by stamp.

    Attributes:
        stamps: (N,) int64 nanoseconds, of the messages' headers (when the sensor measured).
        logged: (N,) int64 nanoseconds, when each was recorded, by which the bag finds it.
    """

    stamps: np.ndarray
    logged: np.ndarray

    @property
    def seconds(self) -> np.ndarray:
        """(N,) float64 stamps in seconds."""
        return self.stamps / NANO


class Bag:
    """An open bag: a `.bag` of ROS 1, a folder with `metadata.yaml` or a bare `.mcap` or `.db3` of ROS 2.

    Messages are read from disk when asked for, by one thread at a time.

    Args:
        path: file or folder.

    Raises:
        UserError: the library `rosbags` is not installed.
        InputError: the bag cannot be read.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._lock = threading.Lock()
        self._reader = _open_reader(path)
        self.topics = {
            name: Topic(name, info.msgtype or "several types", info.msgcount)
            for name, info in sorted(self._reader.topics.items())
        }

    def of_type(self, *types: str) -> list[Topic]:
        """The topics of some types that have a message."""
        return [topic for topic in self.topics.values() if topic.type in types and topic.count]

    def first(self, topic: str) -> Any:
        """The first message of a topic.

        Raises:
            BadMessage: it cannot be read, or there is none.
        """
        for _, message in self.messages(topic):
            return message
        raise BadMessage(f"no message of {topic}")

    def messages(self, topic: str) -> Iterator[tuple[int, Any]]:
        """All messages of a topic in the order of recording, each with the time of recording in nanoseconds.

        Raises:
            BadMessage: one cannot be read; those after it can not be asked for either.
        """
        connections = self._reader.topics[topic].connections
        with self._lock:
            raw = self._reader.messages(connections=connections)
            while (item := _guarded(next, raw, None)) is not None:
                yield item[1], _guarded(self._reader.deserialize, item[2], item[0].msgtype)

    def index(self, topics: Iterable[str]) -> dict[str, MessageIndex]:
        """Stamps of all messages of some topics whose types begin with a header, by one pass over the bag.

        A recording whose headers are all of stamp zero (some drivers never set it) has the times of recording instead.

        Raises:
            InputError: a part of the bag cannot be read.
        """
        entries: dict[str, list[tuple[int, int]]] = {topic: [] for topic in topics}
        connections = [c for topic in entries for c in self._reader.topics[topic].connections]
        try:
            with self._lock:
                for connection, logged, raw in self._reader.messages(connections=connections):
                    entries[connection.topic].append((self._stamp(raw, logged), logged))
        except Exception as error:  # the library lets errors of struct, SQLite and the decompressors through
            raise _damaged(self.path, error) from error
        return {topic: _sorted_index(np.array(rows, dtype=np.int64).reshape(-1, 2)) for topic, rows in entries.items()}

    def read(self, topic: str, stamp: int, logged: int) -> Any:
        """The message of a topic with this header stamp that was recorded at `logged`, both in nanoseconds.

        Raises:
            BadMessage: it cannot be read.
        """
        connections = self._reader.topics[topic].connections
        with self._lock:
            found = _guarded(list, self._reader.messages(connections=connections, start=logged, stop=logged + 1))
            if not found:
                raise BadMessage(f"no message of {topic} at {logged} ns")
            # several may have been recorded in one nanosecond; without header stamps the first is as good as any
            connection, _, raw = next((m for m in found if self._stamp(m[2], m[1]) == stamp), found[0])
            return _guarded(self._reader.deserialize, raw, connection.msgtype)

    def _stamp(self, raw: bytes, logged: int) -> int:
        """Nanoseconds of the header that a message begins with; the time of recording where it is cut off."""
        if len(raw) < 12:
            return logged
        if not self._reader.is2:
            _, seconds, nano = struct.unpack_from("<III", raw)  # a sequence number comes first
        else:
            # four bytes of CDR's encapsulation, the second of which tells the order of bytes
            seconds, nano = struct.unpack_from("<iI" if raw[1] & 1 else ">iI", raw, 4)
        return seconds * NANO + nano


def _open_reader(path: Path) -> AnyReader:
    try:
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_typestore
    except ImportError:
        raise UserError(f"{path}: reading bags needs rosbags; install it with: {install_command('ros')}") from None
    try:
        # ROS 2 recorded no definitions of messages before Iron; those of images did not change since
        reader = AnyReader([path], default_typestore=get_typestore(Stores.ROS2_HUMBLE))
        reader.open()
    except Exception as error:
        raise _damaged(path, error) from error
    return reader


def _sorted_index(rows: np.ndarray) -> MessageIndex:
    if not rows[:, 0].any():
        rows[:, 0] = rows[:, 1]
    rows = rows[np.argsort(rows[:, 0], kind="stable")]
    return MessageIndex(rows[:, 0], rows[:, 1])


def _guarded(function: Any, *arguments: Any) -> Any:
    """The function's result; every error of reading a message as `BadMessage`."""
    try:
        return function(*arguments)
    except Exception as error:  # of the library, struct, SQLite, a decompressor or numpy: all mean a damaged message
        raise BadMessage(_text(error)) from error


def _damaged(path: Path, error: Exception) -> InputError:
    remedy = "check that the recording was ended well; `rosbag reindex` or `ros2 bag reindex` repairs one that was not"
    return InputError(path, "a ROS 1 or ROS 2 bag", _text(error), remedy)


def _text(error: Exception) -> str:
    return " ".join(str(error).split()) or type(error).__name__
