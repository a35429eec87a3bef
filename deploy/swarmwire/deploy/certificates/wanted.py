"""A certificate that somebody asks for, checked before anything is written."""

import ipaddress
import re
from collections.abc import Sequence
from dataclasses import dataclass

from swarmwire.comms.errors import BadInput
from swarmwire.comms.wire.keys import fault_of_name
from swarmwire.deploy.certificates.files import AUTHORITY
from swarmwire.deploy.certificates.purposes import PURPOSES, ROBOT, checked_purpose

_LABEL = "[A-Za-z0-9_](?:[A-Za-z0-9_-]{0,61}[A-Za-z0-9_])?"
_HOST = re.compile(rf"(?=.{{1,253}}$){_LABEL}(?:\.{_LABEL})*")


@dataclass(frozen=True)
class Wanted:
    """Whose certificate, what for, and at which addresses its owner listens: IP addresses or names of hosts.

    Without purpose or hosts it has those of the name's certificate before.
    """

    name: str
    purpose: str | None = None
    hosts: tuple[str, ...] = ()

    @property
    def usual_purpose(self) -> str:
        """What a first certificate of the name is for, unless it is told."""
        return self.name if self.name in PURPOSES else ROBOT


def wanted(name: str, hosts: Sequence[str] = (), purpose: str | None = None) -> Wanted:
    """What is asked for; BadInput for a name, host or purpose that is none, and for the name of the CA's own files."""
    fault = fault_of_name(name)
    if fault is None and name.lower() == AUTHORITY:
        fault = f"expected another name: {AUTHORITY}.pem is the CA's own"
    if fault is not None:
        raise BadInput("NAME", "", fault)
    for host in hosts:
        if not _is_host(host):
            raise BadInput("--host", "", f"expected an IP address or the name of a host, got {host!r}")
    return Wanted(name, checked_purpose(purpose), tuple(dict.fromkeys(host for host in hosts if host != name)))


def _is_host(host: str) -> bool:
    try:
        ipaddress.ip_address(host)
    except ValueError:
        # A last label of digits only would be a mistyped address.
        return _HOST.fullmatch(host) is not None and not host.rsplit(".", 1)[-1].isdigit()
    return True
