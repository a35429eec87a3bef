"""One end of a run's network: its own certificate, and the rights of others.

Both come from options of the command line, or from a folder of certificates. The folder may be that of the CA, or a
copy on another machine of ca.pem, the register certs.json, and the certificates and keys that belong to that machine.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from swarmwire.comms.errors import BadInput
from swarmwire.comms.wire.access_control import OPERATOR, WORLD, RunAccess
from swarmwire.comms.wire.network import Network
from swarmwire.deploy.certificates.register import (
    AUTHORITY,
    OBSERVER,
    REGISTER,
    ROUTER,
    RUNNER,
    Register,
    certificate_path,
    key_path,
)

WARNING = "insecure: every host in the network can take part in the run, read its packets and end it"


@dataclass(frozen=True)
class Member:
    """Certificates and rights of a world, a router, a runner or an observer; without certificates there are no rights.

    Attributes:
        network: the settings that sessions take, without endpoints.
        access: the rights of each name, for members that listen; None: members cannot be distinguished.
    """

    network: Network
    access: RunAccess | None

    def warning(self, endpoints: Sequence[str]) -> str | None:
        """The warning for the user, if these endpoints reach beyond this machine without certificates."""
        told = replace(self.network, listen=tuple(endpoints)).warning
        return WARNING if told and self.network.insecure else None  # without --insecure they are refused


def member(
    purpose: str,
    *,
    certs: Path | None = None,
    name: str | None = None,
    files: tuple[Path | None, Path | None, Path | None] = (None, None, None),
    access: RunAccess | None = None,
    revoked: Sequence[str] = (),
    insecure: bool = False,
) -> Member:
    """What the options say: a folder of certificates, or `files` (ca, certificate, key) and names, or neither.

    BadInput where they contradict each other, or a file is missing.
    """
    named = access or RunAccess()
    if certs is not None:
        if any(files) or named != RunAccess() or insecure:
            raise BadInput("--certs", str(certs), "expected no other certificates, names of members or --insecure")
        # Whoever lets others in must know whom; a runner's machine has its own files alone.
        judges = purpose in (WORLD, ROUTER) or (certs / REGISTER).exists()
        found = access_in(certs) if judges else RunAccess()
        found = replace(found, revoked=(*found.revoked, *revoked))
        found.check(str(certs))
        return Member(replace(network_in(certs, purpose, name), revoked=found.revoked), found)
    if name is not None:
        raise BadInput("--name", name, "expected --certs with it")
    ca, certificate, key = files
    network = Network(ca=ca, certificate=certificate, key=key, revoked=tuple(revoked), insecure=insecure)
    network.check_files("", "network")
    if not network.proves:
        if named != RunAccess():
            raise BadInput("", "names of members", "expected certificates with them: --certs, or --ca and its company")
        return Member(network, None)
    named = replace(named, revoked=tuple(revoked))
    named.check()
    return Member(network, named)


def access_in(folder: Path) -> RunAccess:
    """Everybody who has a certificate, by what the last one of the name is for; BadInput without a register."""
    register = Register.read(folder)
    purpose_of = {issued.name: issued.purpose for issued in register.certificates}

    def named(purpose: str) -> tuple[str, ...]:
        return tuple(name for name, of in purpose_of.items() if of == purpose)

    return RunAccess(
        runners=named(RUNNER),
        observers=named(OBSERVER),
        operators=named(OPERATOR),
        routers=named(ROUTER),
        revoked=tuple(register.revoked()),
        worlds=named(WORLD),
    )


def network_in(folder: Path, purpose: str, name: str | None = None) -> Network:
    """Settings with the CA, and with the certificate and key of that name, or of the only one for that purpose.

    BadInput if the files are not there, or if it is not clear whose they should be.
    """
    held = name or _only(folder, purpose)
    network = Network(
        ca=certificate_path(folder, AUTHORITY), certificate=certificate_path(folder, held), key=key_path(folder, held)
    )
    network.check_files(str(folder), held)
    return network


def _only(folder: Path, purpose: str) -> str:
    keys = sorted(path.stem for path in folder.glob("*.key") if path.stem != AUTHORITY)
    if (folder / REGISTER).exists():
        purpose_of = {issued.name: issued.purpose for issued in Register.read(folder).certificates}
        keys = [name for name in keys if purpose_of.get(name) == purpose]
    if len(keys) == 1:
        return keys[0]
    found = f"{', '.join(keys)} are there: name one" if keys else "there is none"
    raise BadInput(str(folder), "", f"expected a certificate with its key for a {purpose}; {found}")
