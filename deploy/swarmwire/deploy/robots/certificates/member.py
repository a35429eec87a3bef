"""Credentials of a member of a run's network: its certificate, and the rights of all members.

They come from a folder of certificates: that of the CA, or a copy on another machine of ca.pem, the register
certs.json, and the certificates and keys of that machine. A folder without a register belongs to a runner or to another
CA; options of the command line then name the members.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.wire.access_control import OPERATOR, WORLD, RunAccess
from swarmwire.comms.wire.network import Network, as_options
from swarmwire.deploy.robots.certificates.register import (
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
class MemberCredentials:
    """Certificates and rights of a world, a router, a runner or an observer; without certificates all have all rights.

    Attributes:
        network: settings of sessions, without endpoints.
        access: rights of each name, for members that listen; None: members cannot be distinguished.
    """

    network: Network
    access: RunAccess | None

    def check(self, option: str, *endpoints: str) -> None:
        """Raise BadInput about an option of the command line unless this member may use all its endpoints."""
        try:
            for endpoint in endpoints:
                self.network.check_endpoint(endpoint, "", option)
        except BadInput as error:
            raise BadInput(option, "", as_options(error.expected)) from None

    def warning(self, endpoints: Sequence[str]) -> str | None:
        """Return a warning if these endpoints reach beyond this machine without certificates."""
        network = replace(self.network, listen=tuple(endpoints))
        return WARNING if network.warning and self.network.insecure else None  # without --insecure they are refused


def member(
    purpose: str,
    *,
    certs: Path | None = None,
    name: str | None = None,
    access: RunAccess | None = None,
    revoked: Sequence[str] = (),
    insecure: bool = False,
) -> MemberCredentials:
    """Return the credentials of options: a folder of certificates and, without a register, the names of members.

    BadInput if options contradict each other, or a file is missing.
    """
    rights = access or RunAccess()
    if certs is None:
        for option, is_set in (
            ("--name", name),
            ("--revoked", revoked),
            ("--runner, --router and so on", rights != RunAccess()),
        ):
            if is_set:
                raise BadInput(option, "", "expected --certs with it")
        return MemberCredentials(Network(insecure=insecure), None)
    if insecure:
        raise BadInput("--insecure", "", "expected either --certs or --insecure")
    if (certs / REGISTER).exists():
        if rights != RunAccess():
            raise BadInput(str(certs / REGISTER), "", "names the members: expected no --runner, --router and so on")
        rights = access_in(certs)
    elif rights == RunAccess() and purpose in (WORLD, ROUTER):  # members that others connect to
        raise BadInput(str(certs), "", f"expected {REGISTER}, or the names of members: --runner NAME and so on")
    rights = replace(rights, revoked=(*rights.revoked, *revoked))
    rights.check(str(certs))
    return MemberCredentials(replace(network_in(certs, purpose, name), revoked=rights.revoked), rights)


def access_in(folder: Path) -> RunAccess:
    """Return the rights by the purpose of each name's last certificate; BadInput without a register."""
    register = Register.read(folder)
    purpose_of = {issued.name: issued.purpose for issued in register.certificates}

    def names_for(purpose: str) -> tuple[str, ...]:
        return tuple(name for name, other in purpose_of.items() if other == purpose)

    return RunAccess(
        runners=names_for(RUNNER),
        observers=names_for(OBSERVER),
        operators=names_for(OPERATOR),
        routers=names_for(ROUTER),
        revoked=tuple(register.revoked()),
        worlds=names_for(WORLD),
    )


def network_in(folder: Path, purpose: str, name: str | None = None) -> Network:
    """Return settings with the CA and the certificate and key of a name, by default of the only one for the purpose.

    BadInput if the files do not exist, or if several certificates fit.
    """
    owner = name or _only(folder, purpose)
    network = Network(
        ca=certificate_path(folder, AUTHORITY), certificate=certificate_path(folder, owner), key=key_path(folder, owner)
    )
    network.check_files(str(folder), owner)
    return network


def _only(folder: Path, purpose: str) -> str:
    keys = sorted(path.stem for path in folder.glob("*.key") if path.stem != AUTHORITY)
    if (folder / REGISTER).exists():
        purpose_of = {issued.name: issued.purpose for issued in Register.read(folder).certificates}
        keys = [name for name in keys if purpose_of.get(name) == purpose]
    if len(keys) == 1:
        return keys[0]
    remedy = f"got {', '.join(keys)}: choose one by --name" if keys else "there is none"
    raise BadInput(str(folder), "", f"expected one certificate with its key for a {purpose}; {remedy}")
