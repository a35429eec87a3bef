"""The addresses of robots' interfaces, derived from the scenario's network and the robot's index."""

from collections.abc import Generator, Sequence
from dataclasses import dataclass
from ipaddress import IPv4Address, IPv4Interface, IPv4Network, IPv6Address, IPv6Interface
from pathlib import Path

from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.base.ethernet import station
from swarmwire.comms.radio.config.radio import Interface

KEY = "radio.interface.network"
ULA_NETWORK = 0xFD53_0057 << 96  # fd53:57::/64, unique local addresses (RFC 4193)
ULA_PREFIX_BITS = 64
MIN_IPV6_MTU_BYTES = 1280  # RFC 8200
ROUTES = Path("/proc/net/route")  # routes in this process's network namespace
ROUTE_HEADER_LINES = 1
IS_GATEWAY = 0x2  # RTF_GATEWAY: a route to another network


@dataclass(frozen=True, slots=True)
class Addresses:
    """The addresses of one robot."""

    mac: bytes
    ipv4: IPv4Interface
    ipv6: IPv6Interface | None  # besides the link-local address; None: the MTU is too small for IPv6

    @property
    def mac_text(self) -> str:
        """Text of the MAC address, such as 02:53:57:00:00:01."""
        return self.mac.hex(":")


def addresses_of(interface: Interface, robots: int, mtu_bytes: int, where: str) -> tuple[Addresses, ...]:
    """Return the addresses of an arena's robots; BadInput if the network has too few."""
    network = IPv4Network(interface.network)
    usable = network.num_addresses - 2
    if usable < robots:
        raise BadInput(where, KEY, f"expected a network of at least {robots} addresses (the robots), got {network}")
    has_ipv6 = mtu_bytes >= MIN_IPV6_MTU_BYTES
    return tuple(
        Addresses(
            station(robot),
            IPv4Interface((network.network_address + robot + 1, network.prefixlen)),
            IPv6Interface((IPv6Address(ULA_NETWORK + robot + 1), ULA_PREFIX_BITS)) if has_ipv6 else None,
        )
        for robot in range(robots)
    )


def check_unused(interface: Interface, where: str, routes: str | None = None, user: str = "this machine") -> None:
    """Raise BadInput if a device of this machine, or of another user, has addresses of the network.

    `routes` is the content of the user's /proc/net/route, and by default read from there.
    """
    network = IPv4Network(interface.network)
    for name, connected in _connected(ROUTES.read_text() if routes is None else routes):
        if network.overlaps(connected):
            expected = f"expected a network that {user} does not use: {name} has {connected}"
            raise BadInput(where, KEY, f"{expected}; got {network}")


def has_default_route(routes: str) -> bool:
    """Return True if a content of /proc/net/route has a route to all addresses."""
    return any(not network.prefixlen for _, network, _ in _parsed(routes))


def _connected(routes: str) -> Sequence[tuple[str, IPv4Network]]:
    """Return the names of interfaces, and the networks to which they are connected."""
    return [(name, network) for name, network, flags in _parsed(routes) if not flags & IS_GATEWAY and network.prefixlen]


def _parsed(routes: str) -> Generator[tuple[str, IPv4Network, int]]:
    """Yield name of the device, network and flags of each route."""
    for line in routes.splitlines()[ROUTE_HEADER_LINES:]:
        name, destination, _, flags, _, _, _, mask, *_ = line.split()
        yield name, IPv4Network((_address(destination), str(_address(mask)))), int(flags, 16)


def _address(text: str) -> IPv4Address:
    return IPv4Address(bytes.fromhex(text)[::-1])  # the text has the processor's byte order
