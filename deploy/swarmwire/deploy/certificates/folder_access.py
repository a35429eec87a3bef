"""What a folder of certificates says of a run: who may take part, and the certificate that is this machine's own.

The folder may be that of the CA, or a copy on another machine of ca.pem, the register certs.json, and the certificates
and keys that belong to that machine.
"""

from pathlib import Path

from swarmwire.comms.errors import BadInput
from swarmwire.comms.wire.access_control import OPERATOR, WORLD, RunAccess
from swarmwire.comms.wire.network import Network
from swarmwire.deploy.certificates.files import AUTHORITY, REGISTER, certificate_path, key_path
from swarmwire.deploy.certificates.purposes import OBSERVER, ROUTER, RUNNER
from swarmwire.deploy.certificates.register import Register


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


def name_in(network: Network) -> str:
    """Whose certificate it is, by the name of its file, as `swarmwire certs` writes it."""
    return network.certificate.stem if network.certificate else ""


def _only(folder: Path, purpose: str) -> str:
    keys = sorted(path.stem for path in folder.glob("*.key") if path.stem != AUTHORITY)
    if (folder / REGISTER).exists():
        purpose_of = {issued.name: issued.purpose for issued in Register.read(folder).certificates}
        keys = [name for name in keys if purpose_of.get(name) == purpose]
    if len(keys) == 1:
        return keys[0]
    found = f"{', '.join(keys)} are there: name one" if keys else "there is none"
    raise BadInput(str(folder), "", f"expected a certificate with its key for a {purpose}; {found}")
