"""The network settings of one member: its endpoints and certificates, and checks that they exist and are safe."""

import ipaddress
from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, cast

from swarmwire.comms.base.config import did_you_mean
from swarmwire.comms.base.errors import BadInput

PROTOCOLS = ("tcp", "udp", "tls", "quic", "ws", "unixsock-stream")  # protocols of zenoh's wheel
PROVEN = ("tls", "quic")  # protocols with certificates of both ends
GROUP_AND_OTHERS = 0o077  # file mode bits for access by anyone but the owner
_INSECURE = "{}; expected ca, certificate and key, or insecure = true"


@dataclass(frozen=True)
class Network:
    """The settings of one member: a robot, the run, or the operator.

    Attributes:
        listen: endpoints for connections of others, such as "tls/0.0.0.0:7447"; port 0: any free port.
        connect: endpoints of other members; this member retries until they answer, and again when a link is lost.
        multicast: True if members in the same network discover one another by multicast.
        ca: certificate of the authority that signed the members' certificates, PEM; requires `certificate` and `key`.
        certificate: this member's certificate, with its name as common name.
        key: the certificate's private key; only the file's owner may read it.
        operator: certificate name of the member that may query robots' status and stop them.
        tracker: certificate name of the member that publishes poses and serves the radio medium.
        revoked: names whose certificates are no longer valid.
        insecure: True if it may connect beyond this machine without certificates.
    """

    listen: tuple[str, ...] = ()
    connect: tuple[str, ...] = ()
    multicast: bool = False
    ca: Path | None = None
    certificate: Path | None = None
    key: Path | None = None
    operator: str = "operator"
    tracker: str = "tracker"
    revoked: tuple[str, ...] = ()
    insecure: bool = False

    @classmethod
    def from_mapping(cls, table: Mapping[str, Any], where: str, folder: Path, key: str = "network") -> "Network":
        """Read the settings from a table of a file, with paths relative to `folder`; BadInput if they are invalid."""
        keys = [field.name for field in fields(cls)]
        for name in table:
            if name not in keys:
                raise BadInput(where, f"{key}.{name}", f"unknown; expected {did_you_mean(keys, name)}")
        values = {name: _typed(value, name, folder, where, f"{key}.{name}") for name, value in table.items()}
        network = cls(**values)
        network.check(where, key)
        return network

    def check(self, where: str, key: str = "network") -> None:
        """Raise BadInput unless it has an endpoint, its files exist, and it is safe or set to insecure."""
        if not (self.listen or self.connect or self.multicast):
            raise BadInput(where, key, "expected listen, connect or multicast = true: no peer would be reached")
        for name in ("listen", "connect"):
            for endpoint in cast("tuple[str, ...]", getattr(self, name)):
                _check_endpoint(endpoint, where, f"{key}.{name}")
        self.check_files(where, key)
        for name in ("listen", "connect"):
            for endpoint in cast("tuple[str, ...]", getattr(self, name)):
                self._check_proven(endpoint, where, f"{key}.{name}")
        if self.multicast and not self.proves and not self.insecure:
            raise BadInput(where, f"{key}.multicast", _INSECURE.format("multicast reaches beyond this machine"))

    @property
    def proves(self) -> bool:
        """True if this member has a certificate and requires certificates of others."""
        return self.certificate is not None

    @property
    def warning(self) -> str | None:
        """Warning about an insecure network, which others could join; None if the network is safe."""
        reaches_beyond = self.multicast or not all(map(is_local, (*self.listen, *self.connect)))
        if self.proves or not reaches_beyond:
            return None
        return "network: insecure = true: every machine in the network can drive and stop the robots and read packets"

    def check_files(self, where: str, key: str) -> None:
        """Raise BadInput unless no file or all three files are set and exist, and only the owner may read the key."""
        files = {name: cast("Path | None", getattr(self, name)) for name in ("ca", "certificate", "key")}
        if all(path is None for path in files.values()):
            return
        for name, path in files.items():
            if path is None:
                raise BadInput(where, f"{key}.{name}", "is missing: ca, certificate and key go together")
            try:
                exists = path.is_file()
            except OSError as error:  # a folder without permission, or an impossible name
                raise BadInput(where, f"{key}.{name}", f"expected a readable file, got {path}: {error}") from None
            if not exists:
                raise BadInput(where, f"{key}.{name}", f"expected a file, {path} is none")
        assert self.key is not None
        if self.key.stat().st_mode & GROUP_AND_OTHERS:
            raise BadInput(where, f"{key}.key", f"expected a file that its owner alone may read: chmod 600 {self.key}")

    def check_endpoint(self, endpoint: str, where: str, key: str) -> None:
        """Raise BadInput unless this member may use the endpoint, with or without certificates."""
        _check_endpoint(endpoint, where, key)
        self.check_safe(endpoint, where, key)

    def check_safe(self, endpoint: str, where: str, key: str) -> None:
        """Raise BadInput for an endpoint beyond this machine whose other end needs no certificate."""
        if protocol_of(endpoint) in PROVEN or not is_local(endpoint):
            self._check_proven(endpoint, where, key)

    def _check_proven(self, endpoint: str, where: str, key: str) -> None:
        protocol = protocol_of(endpoint)
        if self.proves:
            if protocol not in PROVEN:
                raise BadInput(where, key, f'expected {" or ".join(PROVEN)} with a certificate, got "{endpoint}"')
        elif protocol in PROVEN:
            raise BadInput(where, key, f'expected ca, certificate and key with "{endpoint}"')
        elif not self.insecure and not is_local(endpoint):
            raise BadInput(where, key, _INSECURE.format(f'"{endpoint}" reaches beyond this machine'))


def protocol_of(endpoint: str) -> str:
    """Return the protocol of an endpoint.

    >>> protocol_of("tls/10.0.0.5:7447")
    'tls'
    """
    return endpoint.partition("/")[0]


def is_local(endpoint: str) -> bool:
    """Return True if only this machine can be at the other end.

    >>> is_local("tcp/127.0.0.1:0"), is_local("tcp/[::1]:7447"), is_local("tcp/0.0.0.0:7447")
    (True, True, False)
    """
    protocol, _, address = endpoint.partition("/")
    if protocol == "unixsock-stream":
        return True
    host = address.rpartition(":")[0].strip("[]")
    try:
        return host == "localhost" or ipaddress.ip_address(host).is_loopback
    except ValueError:  # a host name, which may resolve to any machine
        return False


def as_options(text: str) -> str:
    """Rewrite a hint with keys of network settings for a program that takes a folder of certificates.

    >>> as_options("expected ca, certificate and key, or insecure = true")
    'expected --certs, or --insecure'
    """
    return text.replace("ca, certificate and key", "--certs").replace("insecure = true", "--insecure")


def _check_endpoint(endpoint: str, where: str, key: str) -> None:
    protocol, _, address = endpoint.partition("/")
    host, _, port = address.rpartition(":")
    is_address = (
        address.startswith("/") if protocol == "unixsock-stream" else host and port.isdecimal() and int(port) < 2**16
    )
    if protocol not in PROTOCOLS or not is_address:
        raise BadInput(where, key, f'expected endpoints such as "tls/10.0.0.5:7447", got "{endpoint}"')


def _typed(value: object, name: str, folder: Path, where: str, key: str) -> Any:
    """Convert a value of a file to the attribute's type; BadInput if it has another type."""
    if name in ("listen", "connect", "revoked"):
        if isinstance(value, list) and all(isinstance(item, str) for item in cast("list[object]", value)):
            return tuple(cast("list[str]", value))
        raise BadInput(where, key, f"expected a list of texts, got {value!r}")
    if name in ("multicast", "insecure"):
        if isinstance(value, bool):
            return value
        raise BadInput(where, key, f"expected true or false, got {value!r}")
    if not isinstance(value, str) or not value:
        raise BadInput(where, key, f"expected a text, got {value!r}")
    return folder / value if name in ("ca", "certificate", "key") else value
