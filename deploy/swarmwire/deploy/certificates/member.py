"""One end of a run's network as it is told on the command line: what it shows of itself, and whom it lets in."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from swarmwire.comms.errors import BadInput
from swarmwire.comms.wire.access_control import WORLD, RunAccess
from swarmwire.comms.wire.network import Network
from swarmwire.deploy.certificates.files import REGISTER
from swarmwire.deploy.certificates.folder_access import access_in, network_in
from swarmwire.deploy.certificates.purposes import ROUTER

WARNING = "insecure: whoever is in the network can take part in the run, overhear it and end it"


@dataclass(frozen=True)
class Member:
    """Certificates and rights of a world, a router, a runner or an observer; without certificates there are no rights.

    Attributes:
        network: the settings that sessions take, without endpoints.
        access: who may do what, for those at whom others call; None: nobody can be told from another.
    """

    network: Network
    access: RunAccess | None

    def warning(self, endpoints: Sequence[str]) -> str | None:
        """What to tell the user each time, if these endpoints reach beyond this machine and prove nothing."""
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
