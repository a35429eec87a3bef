"""One end of a run's network: its own certificate, and the rights of others.

Both come from a folder of certificates: that of the CA, or a copy on another machine of ca.pem, the register
certs.json, and the certificates and keys that belong to that machine. A folder without a register is a runner's, or of
another CA, whose members are named in options of the command line.
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
    """Certificates and rights of a world, a router, a runner or an observer; without certificates there are no rights.

    Attributes:
        network: the settings that sessions take, without endpoints.
        access: the rights of each name, for members that listen; None: members cannot be distinguished.
    """

    network: Network
    access: RunAccess | None

    def check(self, option: str, *endpoints: str) -> None:
        """BadInput at the option of the command line unless this member may use all its endpoints."""
        try:
            for endpoint in endpoints:
                self.network.check_endpoint(endpoint, "", option)
        except BadInput as error:
            raise BadInput(option, "", as_options(error.expected)) from None

    def warning(self, endpoints: Sequence[str]) -> str | None:
        """The warning for the user, if these endpoints reach beyond this machine without certificates."""
        told = replace(self.network, listen=tuple(endpoints)).warning
        return WARNING if told and self.network.insecure else None  # without --insecure they are refused


def member(
    purpose: str,
    *,
    certs: Path | None = None,
    name: str | None = None,
    access: RunAccess | None = None,
    revoked: Sequence[str] = (),
    insecure: bool = False,
) -> MemberCredentials:
    """What the options say: a folder of certificates and, if it has no register, the names of members; or neither.

    BadInput where they contradict each other, or a file is missing.
    """
    named = access or RunAccess()
    if certs is None:
        for option, given in (
            ("--name", name),
            ("--revoked", revoked),
            ("--runner, --router and so on", named != RunAccess()),
        ):
            if given:
                raise BadInput(option, "", "expected --certs with it")
        return MemberCredentials(Network(insecure=insecure), None)
    if insecure:
        raise BadInput("--insecure", "", "expected either --certs or --insecure")
    if (certs / REGISTER).exists():
        if named != RunAccess():
            raise BadInput(str(certs / REGISTER), "", "names the members: expected no --runner, --router and so on")
        named = access_in(certs)
    elif named == RunAccess() and purpose in (WORLD, ROUTER):  # which let others in
        raise BadInput(str(certs), "", f"expected {REGISTER}, or the names of members: --runner NAME and so on")
    found = replace(named, revoked=(*named.revoked, *revoked))
    found.check(str(certs))
    return MemberCredentials(replace(network_in(certs, purpose, name), revoked=found.revoked), found)


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
