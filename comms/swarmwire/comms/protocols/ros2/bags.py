"""Bags of ROS 2: read from a file, or a folder with `metadata.yaml` and several files; written as one MCAP file.

Files are `.mcap` or `.db3`, also compressed.
"""

from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import IO, Any, NamedTuple

from swarmwire.comms.base.errors import BadFrame, BadInput
from swarmwire.comms.base.extras import MCAP, ROS2
from swarmwire.comms.protocols.ros2.messages import Messages

METADATA = "metadata.yaml"
SUFFIXES = (".mcap", ".db3")
DISTRO = "jazzy"  # the types that are read and written here are equal in all distributions


class BagMessage(NamedTuple):
    """A message of a bag."""

    topic: str
    kind: str  # its type
    log_ns: int  # time of the recorder
    content: Any
    position: str  # for errors: `message 3 of /robot_1/odom`


def is_bag(path: Path) -> bool:
    """Return True for the folder or a file of a bag, by its name."""
    return (path / METADATA).is_file() if path.is_dir() else path.suffix.lower() in SUFFIXES


def read_bag(path: Path, is_read: Callable[[str, str], bool]) -> Iterator[BagMessage]:
    """Yield the messages of the topics for which `is_read(topic, type)` is True, in the order of the recorder.

    BadInput for a damaged bag, and if rosbags is not installed.
    """
    ROS2.need(str(path))
    messages, counts = Messages(DISTRO), Counter[str]()
    for topic, kind, log_ns, payload in _payloads(path, is_read):
        counts[topic] += 1
        position = f"message {counts[topic]} of {topic}"
        try:
            content = messages.decode(kind, payload)
        except BadFrame as error:
            raise BadInput(str(path), position, f"expected an intact message of the type {kind}: {error}") from None
        yield BagMessage(topic, kind, log_ns, content, position)


def _payloads(path: Path, is_read: Callable[[str, str], bool]) -> Iterator[tuple[str, str, int, bytes]]:
    from rosbags.rosbag2 import Reader

    try:
        with Reader(path) as reader:
            chosen = [link for link in reader.connections if is_read(link.topic, link.msgtype)]
            missing = sum(link.msgcount for link in chosen)
            for link, log_ns, payload in reader.messages(chosen) if chosen else ():
                missing -= 1
                yield link.topic, link.msgtype, log_ns, bytes(payload)
            if missing:  # the reader skips a file whose topics are others than those of metadata.yaml
                raise ValueError(f"{missing} of the messages that it should have are missing")
    except Exception as error:  # noqa: BLE001 - the reader trusts the bytes that it reads: damage may raise anything
        reason = str(error).partition("\n")[0] or type(error).__name__
        raise BadInput(str(path), "", f"expected an intact bag of ROS 2: {reason}") from None


class BagWriter:
    """An MCAP file that is being written, as rosbag2 records it: messages in CDR, with their definitions.

    `ros2 bag` refuses files whose topics have different encodings (rosbag2_cpp, sequential_reader.cpp), so there is no
    JSON. It plays the topics whose types are installed, and warns of others (rosbag2_transport, player.cpp).

    Attributes:
        messages: constructor of messages.
        count: number of messages so far.
    """

    def __init__(self, file: IO[bytes]) -> None:
        """Begin a file; BadInput if the libraries are not installed."""
        MCAP.need("mcap")
        from mcap.writer import CompressionType, Writer

        self.messages, self.count = Messages(DISTRO), 0
        self._writer = Writer(file, compression=CompressionType.ZSTD)
        self._writer.start(profile="ros2", library="swarmwire")
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, int] = {}

    def write(self, topic: str, kind: str, message: Any, time_ns: int) -> None:
        """Write a message; times must not fall."""
        self.write_encoded(topic, kind, self.messages.encode(kind, message), time_ns)

    def write_encoded(self, topic: str, kind: str, payload: bytes, time_ns: int) -> None:
        """Write a message that is encoded already."""
        channel = self._channels.get(topic)
        if channel is None:
            channel = self._channels[topic] = self._writer.register_channel(topic, "cdr", self._schema(kind))
        self._writer.add_message(channel, log_time=time_ns, data=payload, publish_time=time_ns)
        self.count += 1

    def close(self) -> None:
        """Write the index of the file."""
        self._writer.finish()

    def _schema(self, kind: str) -> int:
        if kind not in self._schemas:
            definition = self.messages.definition(kind).encode()
            self._schemas[kind] = self._writer.register_schema(kind, "ros2msg", definition)
        return self._schemas[kind]
