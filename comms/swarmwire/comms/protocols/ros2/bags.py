"""Bags of ROS 2: a file, or a folder with `metadata.yaml` and several files; `.mcap` or `.db3`, also compressed."""

from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

from swarmwire.comms.base.errors import BadFrame, BadInput
from swarmwire.comms.base.extras import ROS2
from swarmwire.comms.protocols.ros2.messages import Messages

METADATA = "metadata.yaml"
SUFFIXES = (".mcap", ".db3")
DISTRO = "jazzy"  # the types that are read here are equal in all distributions


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
