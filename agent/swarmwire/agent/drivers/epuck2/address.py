"""Addresses of e-puck2s: "host" or "host:port"."""

from swarmwire.comms.errors import BadInput
from swarmwire.comms.robots.epuck2.packets import PORT


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
