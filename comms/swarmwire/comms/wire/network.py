"""Where a member of the robots' network listens and whom it calls, and how it proves who it is."""

import ipaddress
from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, cast

from swarmwire.comms.config import did_you_mean
from swarmwire.comms.errors import BadInput

PROTOCOLS = ("tcp", "udp", "tls", "quic", "ws", "unixsock-stream")  # that zenoh's wheel speaks
PROVEN = ("tls", "quic")  # where both ends show a certificate
OF_OTHERS = 0o077  # bits of a file's mode that let others than its owner at it


@dataclass(frozen=True)
class Network:
    """One member's settings: a robot's, the run's, the operator's.

    Attributes:
        listen: endpoints that others may call, such as "tls/0.0.0.0:7447"; port 0: one that is free.
        connect: endpoints of others, which are called until they answer, and again when they are lost.
        multicast: whether members in the same network find one another by themselves.
        ca: the certificate of who signed the members' certificates, PEM; with it go the next two.
        certificate: this member's certificate, with its name as common name.
        key: its key, which its owner alone may read.
        operator: name in the certificate of whoever may ask robots for their state and stop them.
        tracker: name in the certificate of whoever may tell poses and plays the medium.
        revoked: names whose certificates count no more.
        insecure: whether it may do without certificates beyond this machine.
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
    def from_mapping(cls, given: Mapping[str, Any], where: str, folder: Path, key: str = "network") -> "Network":
        """The settings of a table of a file, whose paths are beside it in `folder`; BadInput if they will not do."""
        known = [of.name for of in fields(cls)]
        for name in given:
            if name not in known:
                raise BadInput(where, f"{key}.{name}", f"unknown; expected {did_you_mean(known, name)}")
        values = {name: _typed(value, name, folder, where, f"{key}.{name}") for name, value in given.items()}
        network = cls(**values)
        network.check(where, key)
        return network

    def check(self, where: str, key: str = "network") -> None:
        """BadInput unless it reaches somebody, its files are there, and it is safe or says that it is not."""
        if not (self.listen or self.connect or self.multicast):
            raise BadInput(where, key, "expected listen, connect or multicast = true: nobody would be reached")
        for name in ("listen", "connect"):
            for endpoint in cast("tuple[str, ...]", getattr(self, name)):
                _check_endpoint(endpoint, where, f"{key}.{name}")
        self.check_files(where, key)
        for name in ("listen", "connect"):
            for endpoint in cast("tuple[str, ...]", getattr(self, name)):
                self._check_proven(endpoint, where, f"{key}.{name}")
        if self.multicast and not self.proves and not self.insecure:
            raise BadInput(where, f"{key}.multicast", _SAFE.format("multicast reaches beyond this machine"))

    @property
    def proves(self) -> bool:
        """Whether this member has a certificate, and asks others for theirs."""
        return self.certificate is not None

    @property
    def warning(self) -> str | None:
        """What to tell the user each time, where others could take part unseen."""
        outside = self.multicast or not all(map(is_local, (*self.listen, *self.connect)))
        if self.proves or not outside:
            return None
        return "network: insecure = true: whoever is in the network can drive, stop and overhear the robots"

    def check_files(self, where: str, key: str) -> None:
        """BadInput unless there are all three files of a certificate, or none, and others cannot read the key."""
        files = {name: cast("Path | None", getattr(self, name)) for name in ("ca", "certificate", "key")}
        if all(path is None for path in files.values()):
            return
        for name, path in files.items():
            if path is None:
                raise BadInput(where, f"{key}.{name}", "is missing: ca, certificate and key go together")
            try:
                there = path.is_file()
            except OSError as error:  # in a folder that is not open to this user, or of a name that no file can have
                raise BadInput(where, f"{key}.{name}", f"expected a readable file, got {path}: {error}") from None
            if not there:
                raise BadInput(where, f"{key}.{name}", f"expected a file, {path} is none")
        assert self.key is not None
        if self.key.stat().st_mode & OF_OTHERS:
            raise BadInput(where, f"{key}.key", f"expected a file that its owner alone may read: chmod 600 {self.key}")

    def check_endpoint(self, endpoint: str, where: str, key: str) -> None:
        """BadInput unless it is an endpoint, and one that may be used with this member's certificates, or without."""
        _check_endpoint(endpoint, where, key)
        self.check_safe(endpoint, where, key)

    def check_safe(self, endpoint: str, where: str, key: str) -> None:
        """BadInput if others could be at its other end who prove nothing; of one on this machine it asks nothing."""
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
            raise BadInput(where, key, _SAFE.format(f'"{endpoint}" reaches beyond this machine'))


_SAFE = "{}; expected ca, certificate and key, or insecure = true"


def protocol_of(endpoint: str) -> str:
    """What an endpoint begins with.

    >>> protocol_of("tls/10.0.0.5:7447")
    'tls'
    """
    return endpoint.partition("/")[0]


def is_local(endpoint: str) -> bool:
    """Whether only this machine can be at the other end.

    >>> is_local("tcp/127.0.0.1:0"), is_local("tcp/[::1]:7447"), is_local("tcp/0.0.0.0:7447")
    (True, True, False)
    """
    protocol, _, address = endpoint.partition("/")
    if protocol == "unixsock-stream":
        return True
    host = address.rpartition(":")[0].strip("[]")
    try:
        return host == "localhost" or ipaddress.ip_address(host).is_loopback
    except ValueError:  # a name, which may lead anywhere
        return False


def _check_endpoint(endpoint: str, where: str, key: str) -> None:
    protocol, _, address = endpoint.partition("/")
    host, _, port = address.rpartition(":")
    named = (
        address.startswith("/") if protocol == "unixsock-stream" else host and port.isdecimal() and int(port) < 2**16
    )
    if protocol not in PROTOCOLS or not named:
        raise BadInput(where, key, f'expected endpoints such as "tls/10.0.0.5:7447", got "{endpoint}"')


def _typed(value: object, name: str, folder: Path, where: str, key: str) -> Any:
    """A value of a file as the attribute's type; BadInput if it is of another."""
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
