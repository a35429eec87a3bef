"""Where a driver finds its robot, if that is a place in a network."""

from collections.abc import Mapping
from typing import Any

PORTS = {"epuck2": 1000, "ros2": 7447}  # of drivers' protocols, where the address says none


def driver_endpoint(driver: Mapping[str, Any]) -> tuple[str, int] | None:
    """Host and TCP port of a driver's address; None if it has another kind of address, or none.

    >>> driver_endpoint({"name": "epuck2", "address": "192.168.1.41"})
    ('192.168.1.41', 1000)
    >>> driver_endpoint({"name": "ros2", "address": "tcp/turtle:7448"})
    ('turtle', 7448)
    """
    protocol, slash, rest = str(driver.get("address", "")).rpartition("/")
    if slash and protocol not in ("tcp", "tls"):
        return None
    host, colon, port = rest.rpartition(":")
    if colon and port.isdecimal() and host:
        return host.strip("[]"), int(port)
    known = PORTS.get(str(driver.get("name")))
    return (rest, known) if rest and known else None
