"""Names whose certificates count no more, as the folder of a CA says."""

from pathlib import Path

from swarmwire.deploy.certificates.files import REGISTER
from swarmwire.deploy.certificates.register import Register


def revoked_in(folder: Path) -> list[str]:
    """The names; none of a folder that `swarmwire certs` does not keep. BadInput for a register that cannot be read."""
    return Register.read(folder).revoked() if (folder / REGISTER).exists() else []
