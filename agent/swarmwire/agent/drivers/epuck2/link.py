"""Addresses of e-puck2s: "host" or "host:port"."""

import select
import socket
from collections import Counter

from swarmwire.agent.drivers.driver import DriverLost
from swarmwire.comms.errors import BadFrame, BadInput
from swarmwire.comms.robots.epuck2.commands import Answers
from swarmwire.comms.robots.epuck2.packets import PORT, Header


def host_and_port(address: str) -> tuple[str, int]:
    """Where the robot is; BadInput if the address cannot be one.

    >>> host_and_port("192.168.1.23"), host_and_port("127.0.0.1:11000")
    (('192.168.1.23', 1000), ('127.0.0.1', 11000))
    """
    host, colon, port = address.partition(":")
    number = int(port) if port.isascii() and port.isdigit() else 0
    if not _is_host(host) or (colon and not 0 < number < 65536):
        raise BadInput("driver epuck2", "address", f'expected "host" or "host:port", got {address!r}')
    return host, number if colon else PORT


def _is_host(text: str) -> bool:
    """Whether the text can be a name or number of a computer."""
    try:
        text.encode("idna")  # as it is when it is looked up
    except UnicodeError:
        return False
    return text.isprintable() and not any(c in " /*" for c in text) and text != ""


# --- A TCP connection to an e-puck2: packets out, answers in. It knows no senses and no speeds.


_AT_ONCE = 65536  # bytes read in one call
_MAX_DRAINED = 100  # calls: whoever sends more than that at once is no robot


class RobotLink:
    """One connection. `send` is called under the driver's lock, everything else by the driver's thread.

    Attributes:
        sent: how many commands went out.
        answered: how many answers came; the robot owes one for each command. (The firmware repeats the last one
            unasked, as fast as it can: what comes beyond is as good as what was asked for.)
        newest: the payload of the newest sensors' packet, until somebody takes it away.
    """

    def __init__(self, host: str, port: int, timeout_s: float, counts: Counter[str]) -> None:
        """DriverLost if nobody takes the connection in time."""
        self._counts, self._answers = counts, Answers()
        self.sent, self.answered = 0, 0
        self.newest: bytes | None = None
        try:
            self._socket = socket.create_connection((host, port), timeout_s)
        except OSError as error:
            raise DriverLost(f"no e-puck2 at {host}:{port}: {error}") from error
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._socket.setblocking(False)  # nobody may wait with the lock in hand
        self._arriving = select.poll()
        self._arriving.register(self._socket, select.POLLIN)

    def send(self, packet: bytes) -> None:
        """Hand over a command; DriverLost if the connection takes it no more, or not whole."""
        try:
            taken = self._socket.send(packet)
        except OSError as error:
            raise self._lost("hung_up", f"the connection is gone: {error}") from error
        if taken < len(packet):
            raise self._lost("hung_up", "the robot reads nothing any more")
        self.sent += 1

    def receive(self, timeout_s: float) -> bool:
        """Take in what has come, or comes first within that time; false if nothing did.

        DriverLost if the connection cannot go on.
        """
        if not self._arriving.poll(1000.0 * max(timeout_s, 0.0)):
            return False
        try:
            data = self._socket.recv(_AT_ONCE)
        except OSError as error:
            raise self._lost("hung_up", f"the connection is gone: {error}") from error
        if not data:
            raise self._lost("hung_up", "the robot hung up")
        try:
            for header, payload in self._answers.fed(data):
                self._answered(header, payload)
        except BadFrame as garbage:
            raise self._lost(garbage.fault, f"the robot answers what is no answer: {garbage}") from garbage
        return True

    def drain(self) -> None:
        """Take in what has come so far."""
        for _ in range(_MAX_DRAINED):
            if not self.receive(0.0):
                break
        self.answered = min(self.answered, self.sent)

    def _answered(self, header: Header, payload: bytes) -> None:
        if header is Header.IMAGE:  # it comes before the sensors that belong to the same command
            self._counts["images_skipped"] += 1
            return
        self.answered += 1
        if header is Header.SENSORS:
            self.newest = payload

    def close(self) -> None:
        """Hang up; safe to call more than once."""
        self._socket.close()

    def _lost(self, fault: str, why: str) -> DriverLost:
        self._counts[fault] += 1
        return DriverLost(why)
