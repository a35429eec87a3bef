"""`swarmwire certs revoke`."""

from typing import Annotated

import typer

from swarmwire.comms.clock import WallClock
from swarmwire.comms.extras import CERTIFICATES
from swarmwire.deploy.cli.certs.options import AuthorityFolder


def revoke_command(
    folder: AuthorityFolder, name: Annotated[str, typer.Argument(help="Whose certificates.", metavar="NAME")]
) -> None:
    """Revoke a name for good: under this CA it never gets a certificate again.

    Robots learn of it with their settings (`revoked = ["NAME"]` under network), when they are deployed and restarted;
    a run with gateways reads it beside its --ca. For example, a robot that was stolen:

      swarmwire certs revoke lab-ca flock-3
    """
    CERTIFICATES.need("certs")
    from swarmwire.deploy.certificates.folder import revoke
    from swarmwire.deploy.certificates.register import REVOKED, Register

    revoke(folder, name, WallClock())
    names = ", ".join(f'"{of}"' for of in Register.read(folder).revoked())
    typer.echo(f"written: {folder / REVOKED}; in the robots' settings: revoked = [{names}]")
