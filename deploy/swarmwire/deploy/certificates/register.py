"""`certs.json`: which certificates a CA has issued, and which names are revoked; read without `cryptography`."""

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from datetime import datetime
from pathlib import Path
from typing import Any, Self

from swarmwire.comms.config import check_format, from_json
from swarmwire.comms.errors import BadInput
from swarmwire.deploy.certificates.dates import DAY, date_of, text_of
from swarmwire.deploy.certificates.files import REGISTER
from swarmwire.metrics.atomic import write_text

FORMAT = 1
SOON = 30 * DAY  # before its end a certificate is renewed, at most a third of its life


@dataclass(frozen=True)
class Issued:
    """One certificate: dates as texts, `serial` in hexadecimal digits, `hosts` as in the certificate."""

    name: str
    purpose: str
    serial: str
    hosts: Sequence[str]
    valid_from: str
    valid_until: str
    revoked: str | None = None

    def ends_soon(self, now: datetime) -> bool:
        """Whether it has ended, or is about to."""
        until = date_of(self.valid_until)
        return until - now < min(SOON, (until - date_of(self.valid_from)) / 3)

    def state(self, now: datetime) -> str:
        """What holds at that date: "revoked", "ended", "ends soon" or "valid"."""
        if self.revoked is not None:
            return "revoked"
        if date_of(self.valid_until) <= now:
            return "ended"
        return "ends soon" if self.ends_soon(now) else "valid"


@dataclass(frozen=True)
class Register:
    """The CA, and all certificates that it has issued, in the order of their making."""

    authority: Issued
    certificates: tuple[Issued, ...] = ()

    @classmethod
    def read(cls, folder: Path) -> Self:
        """The register in a CA's folder; BadInput if there is none that can be read."""
        path = folder / REGISTER
        try:
            content: Any = from_json(path.read_text(encoding="utf-8"))
            check_format(content, FORMAT, str(path))
            register = cls(Issued(**content["authority"]), tuple(Issued(**of) for of in content["certificates"]))
            for of in (register.authority, *register.certificates):
                _ = date_of(of.valid_from), date_of(of.valid_until), int(of.serial, 16)
                _ = "".join((of.name, of.purpose, *of.hosts))  # TypeError if one is no text
        except FileNotFoundError:
            raise BadInput(str(folder), "", f"expected a CA's folder: swarmwire certs init {folder}") from None
        except OSError as error:
            raise BadInput(str(path), "", f"expected a readable file: {error.strerror}") from None
        except (ValueError, KeyError, TypeError):
            raise BadInput(str(path), "", "expected the register that `swarmwire certs` keeps") from None
        return register

    def write(self, folder: Path) -> None:
        """Put it into a CA's folder, in place of the one before."""
        content = {
            "format": FORMAT,
            "authority": asdict(self.authority),
            "certificates": [asdict(issued) for issued in self.certificates],
        }
        write_text(folder / REGISTER, json.dumps(content, indent=2) + "\n")

    def last(self, name: str) -> Issued | None:
        """The last certificate of that name, which took the place of those before."""
        return next((issued for issued in reversed(self.certificates) if issued.name == name), None)

    def state_of(self, issued: Issued, now: datetime) -> str:
        """As its own state, but "replaced" if it would still hold, and there is a later one of its name."""
        state = issued.state(now)
        replaced = issued is not self.authority and issued is not self.last(issued.name)
        return "replaced" if replaced and state != "revoked" else state

    def revoked(self) -> list[str]:
        """The names that may do nothing any more: what a peer takes as `revoked`."""
        return sorted({issued.name for issued in self.certificates if issued.revoked is not None})

    def with_issued(self, issued: Issued) -> "Register":
        """This, and one more."""
        return replace(self, certificates=(*self.certificates, issued))

    def with_revoked(self, name: str, now: datetime) -> "Register":
        """This, where all certificates of that name are revoked since that date or since earlier."""
        since = text_of(now)
        return replace(
            self,
            certificates=tuple(
                replace(issued, revoked=issued.revoked or since) if issued.name == name else issued
                for issued in self.certificates
            ),
        )
