"""Files of a certificate authority's (CA's) folder, its register, and requests for certificates.

The register `certs.json` lists the certificates that the CA has issued, and their revocations. This module does not
load `cryptography`.
"""

import ipaddress
import json
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Annotated, Self

from msgspec import Meta, to_builtins

from swarmwire.comms.base.atomic import write_text
from swarmwire.comms.base.clock import NS_PER_S, SCALED_FROM_NS, DatedClock
from swarmwire.comms.base.config import check_format, converted, did_you_mean, from_json
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.wire.access_control import OPERATOR, TRACKER, WORLD
from swarmwire.comms.wire.keys import fault_of_name

FORMAT = 1
AUTHORITY = "ca"  # name of the CA's own certificate
REGISTER = "certs.json"
ROBOT, RUNNER, OBSERVER, ROUTER = "robot", "runner", "observer", "router"
PURPOSES = (
    ROBOT,
    TRACKER,
    OPERATOR,
    RUNNER,
    OBSERVER,
    ROUTER,
    WORLD,
)  # stored in the register alone
DAY = timedelta(days=1)
RENEWAL_PERIOD = 30 * DAY  # before a certificate's end; at most a third of its validity
_MIN_DATE = datetime.fromtimestamp(SCALED_FROM_NS // NS_PER_S, UTC)

_LABEL = "[A-Za-z0-9_](?:[A-Za-z0-9_-]{0,61}[A-Za-z0-9_])?"
_HOST = re.compile(rf"(?=.{{1,253}}$){_LABEL}(?:\.{_LABEL})*")

Date = Annotated[datetime, Meta(tz=True)]  # UTC date, to the second


def certificate_path(folder: Path, name: str) -> Path:
    """Return the path of a name's certificate, in PEM, which anybody may read."""
    return folder / f"{name}.pem"


def key_path(folder: Path, name: str) -> Path:
    """Return the path of a name's key, in PKCS#8 PEM without a password, which only its owner may read."""
    return folder / f"{name}.key"


def no_authority(folder: Path) -> BadInput:
    """Return the error about a folder without a CA, with the command that creates one."""
    return BadInput(str(folder), "", f"expected a CA's folder: swarmwire certs init {folder}")


def date_now(clock: DatedClock) -> datetime:
    """Return the clock's date; BadInput if the clock was never set, since certificates would have a wrong date."""
    now = datetime.fromtimestamp(clock.utc_ns() // NS_PER_S, UTC)
    if now < _MIN_DATE:
        raise BadInput("the clock of this machine", "", f"shows {text_of(now)}: set it first")
    return now


def text_of(date: datetime) -> str:
    """Format a date as 2026-11-21T03:04:05Z."""
    return date.strftime("%Y-%m-%dT%H:%M:%SZ")


@dataclass(frozen=True)
class Issued:
    """One certificate: `serial` in hexadecimal digits, `hosts` as in the certificate."""

    name: str
    purpose: str
    serial: Annotated[str, Meta(pattern="^[0-9a-f]+$")]
    hosts: tuple[str, ...]
    valid_from: Date
    valid_until: Date
    revoked: Date | None = None

    def ends_soon(self, now: datetime) -> bool:
        """Return True if it has ended or ends within the renewal period."""
        return self.valid_until - now < min(RENEWAL_PERIOD, (self.valid_until - self.valid_from) / 3)

    def state(self, now: datetime) -> str:
        """Return its state at that date: "revoked", "ended", "ends soon" or "valid"."""
        if self.revoked is not None:
            return "revoked"
        if self.valid_until <= now:
            return "ended"
        return "ends soon" if self.ends_soon(now) else "valid"


@dataclass(frozen=True)
class Register:
    """The CA, and all certificates that it has issued, the oldest first."""

    authority: Issued
    certificates: tuple[Issued, ...] = ()

    @classmethod
    def read(cls, folder: Path) -> Self:
        """Read the register of a CA's folder; BadInput if that fails."""
        path = folder / REGISTER
        try:
            content = from_json(path.read_text(encoding="utf-8"))
            check_format(content, FORMAT, str(path))
            return converted(cls, content, str(path))
        except FileNotFoundError:
            raise no_authority(folder) from None
        except OSError as error:
            raise BadInput(str(path), "", f"expected a readable file: {error.strerror}") from None
        except ValueError:
            raise BadInput(str(path), "", "expected the register that `swarmwire certs` writes") from None

    def write(self, folder: Path) -> None:
        """Write the register to a CA's folder."""
        write_text(folder / REGISTER, json.dumps({"format": FORMAT, **to_builtins(self)}, indent=2) + "\n")

    def last(self, name: str) -> Issued | None:
        """Return the last certificate of a name, which replaced earlier ones; None without one."""
        return next((issued for issued in reversed(self.certificates) if issued.name == name), None)

    def states(self, now: datetime) -> Iterator[tuple[Issued, str]]:
        """Yield the CA's certificate and all others, each with its state.

        A certificate is "replaced" if there is a later one of its name, unless it is revoked.
        """
        yield self.authority, self.authority.state(now)
        for issued in self.certificates:
            state = issued.state(now)
            yield issued, state if state == "revoked" or issued is self.last(issued.name) else "replaced"

    def revoked(self) -> list[str]:
        """Return the names without any rights: the `revoked` of a peer's network."""
        return sorted({issued.name for issued in self.certificates if issued.revoked is not None})

    def with_issued(self, issued: Issued) -> "Register":
        """Return this register with one more certificate."""
        return replace(self, certificates=(*self.certificates, issued))

    def with_revoked(self, name: str, now: datetime) -> "Register":
        """Return this register with all certificates of a name revoked, at `now` or earlier."""
        return replace(
            self,
            certificates=tuple(
                replace(issued, revoked=issued.revoked or now) if issued.name == name else issued
                for issued in self.certificates
            ),
        )


def revoked_in(folder: Path) -> list[str]:
    """Return the revoked names of a CA's folder, none without a register; BadInput if it cannot be read."""
    return Register.read(folder).revoked() if (folder / REGISTER).exists() else []


@dataclass(frozen=True)
class CertificateRequest:
    """Request for a certificate: its owner, its purpose, and the IP addresses or host names at which the owner listens.

    Purpose and hosts default to those of the name's previous certificate.
    """

    name: str
    purpose: str | None = None
    hosts: tuple[str, ...] = ()

    @property
    def default_purpose(self) -> str:
        """Purpose of the name's first certificate, unless the request has one."""
        return self.name if self.name in PURPOSES else ROBOT


def certificate_request(name: str, hosts: Sequence[str] = (), purpose: str | None = None) -> CertificateRequest:
    """Check and return a request; BadInput for an invalid name, host or purpose, and for the name of the CA."""
    fault = fault_of_name(name)
    if fault is None and name.lower() == AUTHORITY:
        fault = f"expected another name: {AUTHORITY}.pem is the CA's own"
    if fault is not None:
        raise BadInput("NAME", "", fault)
    for host in hosts:
        if not _is_host(host):
            raise BadInput("--host", "", f"expected an IP address or the name of a host, got {host!r}")
    if purpose is not None and purpose not in PURPOSES:
        raise BadInput("--for", "", f"expected {did_you_mean(PURPOSES, purpose)}, got {purpose!r}")
    return CertificateRequest(name, purpose, tuple(dict.fromkeys(host for host in hosts if host != name)))


def _is_host(host: str) -> bool:
    try:
        ipaddress.ip_address(host)
    except ValueError:
        # A last label of digits only would be a mistyped address.
        return _HOST.fullmatch(host) is not None and not host.rsplit(".", 1)[-1].isdigit()
    return True
