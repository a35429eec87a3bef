"""Where emulated e-puck2s answer: an address for each."""

from swarmwire.comms.errors import BadInput
from swarmwire.comms.robots.epuck2.packets import PORT

MOST_HOSTS = 254  # of a network of the last byte
WHERE = "gateway epuck2"
EXPECTED = 'expected "host:port" (ports count up), "127.0.1.*:port" (hosts count up from 1) or "host:0" (any ports)'


def addresses_of(address: str, robots: int) -> list[tuple[str, int]]:
    """Host and port of each robot; BadInput if the address is of no such form, or does not reach for all.

    >>> addresses_of("127.0.0.1:11000", 2), addresses_of("127.0.1.*", 2)
    ([('127.0.0.1', 11000), ('127.0.0.1', 11001)], [('127.0.1.1', 1000), ('127.0.1.2', 1000)])
    """
    host, colon, port = (address or "127.0.0.1:0").partition(":")
    if not host or (colon and not (port.isascii() and port.isdigit())) or host.count("*") > host.endswith(".*"):
        raise BadInput(WHERE, "address", f"{EXPECTED}; got {address!r}")
    first = int(port) if colon else PORT
    if host.endswith("*"):
        if robots > MOST_HOSTS:
            raise BadInput(WHERE, "address", f"expected at most {MOST_HOSTS} robots for {address!r}, got {robots}")
        return [(f"{host[:-1]}{1 + i}", first) for i in range(robots)]
    last = first + robots - 1 if first else 0
    if last > 65535:
        raise BadInput(WHERE, "address", f"expected ports up to 65535, got {first} to {last}")
    return [(host, first + i if first else 0) for i in range(robots)]
