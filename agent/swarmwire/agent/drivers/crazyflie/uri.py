"""URIs of Crazyflies, as cflib takes them: which robot they mean, and by which Crazyradio it is reached."""

import re
from dataclasses import dataclass

from swarmwire.comms.errors import BadInput

RADIO = re.compile(
    r"radio://(?P<radio>\d{1,9}|[0-9A-Fa-f]{10,})/(?P<channel>\d{1,3})"
    r"(/(?P<rate>250K|1M|2M)(/(?P<address>[0-9A-Fa-f]{1,10}))?)?(\?rate_limit=\d+)?"
)
OTHER = re.compile(r"(udp://[^/:]+:\d{1,5}|usb://\d+)")
MAX_CHANNEL = 125
DEFAULT_RATE, DEFAULT_ADDRESS = "2M", "E7E7E7E7E7"  # cflib/crtp/radiodriver.py


@dataclass(frozen=True)
class Uri:
    """What a URI says.

    Attributes:
        target: the robot, the same for each radio that reaches it: "80/2M/E7E7E7E7E7".
        radio: the Crazyradio, by its number or serial number; empty: none.
    """

    target: str
    radio: str = ""


def parsed(uri: str) -> Uri:
    """What the URI says; BadInput for one that cflib would not take, or would take for another.

    >>> parsed("radio://1/80/2M/e7e7e7e702")
    Uri(target='80/2M/E7E7E7E702', radio='1')
    >>> parsed("udp://127.0.0.1:19850")
    Uri(target='udp://127.0.0.1:19850', radio='')
    """
    radio = RADIO.fullmatch(uri)
    if radio and int(radio["channel"]) <= MAX_CHANNEL:
        address = (radio["address"] or DEFAULT_ADDRESS).upper().rjust(10, "0")
        return Uri(f"{int(radio['channel'])}/{radio['rate'] or DEFAULT_RATE}/{address}", radio["radio"].upper())
    if OTHER.fullmatch(uri):
        return Uri(uri)
    expected = f'expected a URI of cflib, "radio://0/80/2M/E7E7E7E7E7" or "udp://host:port"; got {uri!r}'
    raise BadInput("driver crazyflie", "address", expected)
