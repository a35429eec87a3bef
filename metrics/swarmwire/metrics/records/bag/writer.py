"""Writer of MCAP files as rosbag2 records them: messages in CDR, with their definitions.

`ros2 bag` refuses files whose topics have different encodings (rosbag2_cpp, sequential_reader.cpp), so there is no
JSON. It plays the topics whose types are installed, and warns of others (rosbag2_transport, player.cpp).
"""

from typing import IO, Any

from swarmwire.comms.base.extras import MCAP
from swarmwire.comms.protocols.ros2.messages import Messages

DISTRO = "jazzy"  # the used types have the same fields in all distributions


class BagWriter:
    """An MCAP file that is being written.

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
