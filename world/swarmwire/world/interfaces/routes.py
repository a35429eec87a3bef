"""IPv4 routes of multicast and limited broadcast on a robot, through its device, by rtnetlink(7).

Linux sends neither without a route, and a program that joins a group without an interface (INADDR_ANY) joins it on the
interface of that route. The kernel removes these routes when the device goes down or has no address, and later restores
only the routes of its addresses; so `restore` adds the others.
"""

import socket
import struct
from contextlib import suppress
from ipaddress import IPv4Network

ROUTES = IPv4Network("224.0.0.0/4"), IPv4Network("255.255.255.255/32")
RTMGRP_LINK, RTMGRP_IPV4_IFADDR = 0x1, 0x10  # linux/rtnetlink.h, as all below
RTM_NEWLINK, RTM_NEWADDR, RTM_NEWROUTE = 16, 20, 24
NLM_F_REQUEST, NLM_F_EXCL, NLM_F_CREATE = 0x1, 0x200, 0x400  # an existing route is not changed
RT_TABLE_MAIN, RTPROT_BOOT, RT_SCOPE_LINK, RTN_UNICAST = 254, 3, 253, 1
RTA_DST, RTA_OIF = 1, 4
HEADER = struct.Struct("=IHHII")  # struct nlmsghdr
MAX_CHANGES = 64  # most messages per call: a program that keeps changing its device must not stop the world


class MulticastRoutes:
    """The routes of the network namespace in which it is made; it may be used from any namespace."""

    def __init__(self, device: str) -> None:
        """OSError if the device does not exist."""
        self._index = socket.if_nametoindex(device)
        self._netlink = socket.socket(socket.AF_NETLINK, socket.SOCK_RAW, socket.NETLINK_ROUTE)
        self._netlink.setblocking(False)
        self._netlink.bind((0, RTMGRP_LINK | RTMGRP_IPV4_IFADDR))
        self._add()

    def fileno(self) -> int:
        """Return the descriptor that is readable after changes of devices or their addresses."""
        return self._netlink.fileno()

    def restore(self) -> None:
        """Add missing routes if devices or addresses have changed."""
        if not {RTM_NEWLINK, RTM_NEWADDR}.isdisjoint(self._changes()):
            self._add()

    def close(self) -> None:
        """Close the descriptor, and keep the routes; safe to call more than once."""
        self._netlink.close()

    def _changes(self) -> list[int]:
        """Return the types of the messages that arrived: changes, and errors of `_add`."""
        types: list[int] = []
        while len(types) < MAX_CHANGES:
            try:
                types.append(HEADER.unpack(self._netlink.recv(HEADER.size))[1])
            except BlockingIOError:
                break
            except OSError:  # ENOBUFS: the kernel's queue has overflowed
                types.append(RTM_NEWLINK)
        return types

    def _add(self) -> None:
        with suppress(OSError):  # no room for the request
            for network in ROUTES:
                self._netlink.send(_new_route(network, self._index))


def _new_route(network: IPv4Network, device: int) -> bytes:
    """Return the request for a route to `network` through the device with this index (struct rtmsg and attributes)."""
    kind = RT_TABLE_MAIN, RTPROT_BOOT, RT_SCOPE_LINK, RTN_UNICAST
    route = struct.pack("=8BI", socket.AF_INET, network.prefixlen, 0, 0, *kind, 0)
    attributes = struct.pack("=HH4sHHI", 8, RTA_DST, network.network_address.packed, 8, RTA_OIF, device)
    length = HEADER.size + len(route) + len(attributes)
    return HEADER.pack(length, RTM_NEWROUTE, NLM_F_REQUEST | NLM_F_CREATE | NLM_F_EXCL, 0, 0) + route + attributes
