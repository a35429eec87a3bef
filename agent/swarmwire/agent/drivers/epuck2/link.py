"""The TCP connection to an e-puck2: sends packets, and receives answers without their meaning.

An address is "host" or "host:port".
"""

import select
import socket
from collections import Counter

from swarmwire.agent.drivers.driver import DriverLost
from swarmwire.comms.base.errors import BadFrame, BadInput
from swarmwire.comms.protocols.epuck2.packets import PORT, Answers, Header

_READ_BYTES = 65536  # bytes per read
_MAX_READS = 100  # no robot sends more data at once


def host_and_port(address: str) -> tuple[str, int]:
    """Split an address into host and port; BadInput for a malformed one.

    >>> host_and_port("192.168.1.23"), host_and_port("127.0.0.1:11000")
    (('192.168.1.23', 1000), ('127.0.0.1', 11000))
    """
    host, colon, port = address.partition(":")
    number = int(port) if port.isascii() and port.isdigit() else 0
    if not _is_host(host) or (colon and not 0 < number < 65536):
        raise BadInput("driver epuck2", "address", f'expected "host" or "host:port", got {address!r}')
    return host, number if colon else PORT


def _is_host(text: str) -> bool:
    """Return True if the text can be a host name or an IP address."""
    try:
        text.encode("idna")  # the resolver's encoding
    except UnicodeError:
        return False
    return text.isprintable() and not any(c in " /*" for c in text) and text != ""


class RobotLink:
    """One connection. `send` is called under the driver's lock, everything else by the driver's thread.

    Attributes:
        sent: commands sent so far.
        answered: answers received so far; the robot sends one per command. (The firmware also repeats the last one
            unrequested, as fast as it can: these answers are as good as requested ones.)
        newest: the payload of the newest sensors packet, until the driver reads it.
    """

    def __init__(self, host: str, port: int, timeout_s: float, counts: Counter[str]) -> None:
        """Connect; DriverLost if the robot does not accept the connection in time."""
        self._counts, self._answers = counts, Answers()
        self.sent, self.answered = 0, 0
        self.newest: bytes | None = None
        try:
            self._socket = socket.create_connection((host, port), timeout_s)
        except OSError as error:
            raise DriverLost(f"no e-puck2 at {host}:{port}: {error}") from error
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._socket.setblocking(False)  # no call may block under the driver's lock
        self._arriving = select.poll()
        self._arriving.register(self._socket, select.POLLIN)

    def send(self, packet: bytes) -> None:
        """Send a command; DriverLost if the connection does not accept all of its bytes."""
        try:
            sent_bytes = self._socket.send(packet)
        except OSError as error:
            raise self._fault("hung_up", f"the connection is gone: {error}") from error
        if sent_bytes < len(packet):
            raise self._fault("hung_up", "the robot reads nothing any more")
        self.sent += 1

    def receive(self, timeout_s: float) -> bool:
        """Read the data that has arrived, or the first that arrives in time; return False if none does.

        DriverLost if the connection is broken.
        """
        if not self._arriving.poll(1000.0 * max(timeout_s, 0.0)):
            return False
        try:
            data = self._socket.recv(_READ_BYTES)
        except OSError as error:
            raise self._fault("hung_up", f"the connection is gone: {error}") from error
        if not data:
            raise self._fault("hung_up", "the robot hung up")
        try:
            for header, payload in self._answers.fed(data):
                self._on_answer(header, payload)
        except BadFrame as garbage:
            raise self._fault(garbage.fault, f"the robot sent a malformed answer: {garbage}") from garbage
        return True

    def drain(self) -> None:
        """Read all data that has arrived so far."""
        for _ in range(_MAX_READS):
            if not self.receive(0.0):
                break
        self.answered = min(self.answered, self.sent)

    def _on_answer(self, header: Header, payload: bytes) -> None:
        if header is Header.IMAGE:  # the sensors packet of the same command follows
            self._counts["images_skipped"] += 1
            return
        self.answered += 1
        if header is Header.SENSORS:
            self.newest = payload

    def close(self) -> None:
        """Close the connection; safe to call more than once."""
        self._socket.close()

    def _fault(self, name: str, reason: str) -> DriverLost:
        self._counts[name] += 1
        return DriverLost(reason)
