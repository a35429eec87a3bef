"""How much of what a connection has brought its client has not read yet, from the kernel (Linux's sock_diag(7))."""

import socket
import struct
import sys

SOCK_DIAG, BY_FAMILY, REQUEST = 4, 20, 1  # a netlink protocol, the type of its messages, and the flag of a request
ANY = 0xFFFFFFFF  # state of a connection, and cookie
_HEADER = struct.Struct("=IHHII")  # nlmsghdr: length, type, flags, number, sender
_ASKED = struct.Struct("=BBBxI")  # inet_diag_req_v2: family, protocol, further facts, states
_ID = struct.Struct("!HH4s12x4s12x12s")  # inet_diag_sockid: ports and addresses of either end, interface and cookie
_ANY_INTERFACE = struct.pack("=III", 0, ANY, ANY)
_UNREAD = struct.Struct("=I")
_UNREAD_AT = _HEADER.size + 4 + _ID.size + 4  # idiag_rqueue of inet_diag_msg
ANSWER_BYTES = 4096


class UnreadBytes:
    """Looks into the clients' ends of connections: of IPv4, and in the network of this machine."""

    def __init__(self) -> None:
        self._kernel = None
        if sys.platform == "linux":
            self._kernel = socket.socket(socket.AF_NETLINK, socket.SOCK_RAW, SOCK_DIAG)

    def of(self, connection: socket.socket) -> int:
        """Bytes that have arrived and wait for the client at the other end; 0 where it is on another machine."""
        if self._kernel is None:
            return 0
        (client, client_port), (robot, robot_port) = connection.getpeername(), connection.getsockname()
        ends = _ID.pack(client_port, robot_port, socket.inet_aton(client), socket.inet_aton(robot), _ANY_INTERFACE)
        asked = _ASKED.pack(socket.AF_INET, socket.IPPROTO_TCP, 0, ANY) + ends
        self._kernel.send(_HEADER.pack(_HEADER.size + len(asked), BY_FAMILY, REQUEST, 0, 0) + asked)
        answer = self._kernel.recv(ANSWER_BYTES)
        _, kind, *_ = _HEADER.unpack_from(answer)
        return _UNREAD.unpack_from(answer, _UNREAD_AT)[0] if kind == BY_FAMILY else 0

    def close(self) -> None:
        """Close the socket to the kernel."""
        if self._kernel is not None:
            self._kernel.close()
