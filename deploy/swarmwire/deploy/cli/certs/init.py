"""`swarmwire certs init`."""

from typing import Annotated

import typer

from swarmwire.comms.clock import WallClock
from swarmwire.comms.extras import CERTIFICATES
from swarmwire.deploy.cli.certs.options import AuthorityFolder


def init_command(
    folder: AuthorityFolder,
    renew: Annotated[
        bool, typer.Option("--renew", help="Make another CA in its place; the old folder is kept under another name.")
    ] = False,
) -> None:
    """Begin a CA, good for ten years, in a new folder that you alone may enter.

    Its key, ca.key, signs who belongs to the swarm: keep the folder where no robot and no repository gets at it. For
    example:

      swarmwire certs init lab-ca
    """
    CERTIFICATES.need("certs")
    from swarmwire.deploy.certificates.folder import begin_authority, renew_authority

    if renew:
        typer.echo(f"kept: {renew_authority(folder, WallClock())}")
        typer.echo("every member of the network needs a new certificate and the new ca.pem")
    else:
        begin_authority(folder, WallClock())
    typer.echo(f"written: {folder / 'ca.pem'}, for everybody, and {folder / 'ca.key'}, for nobody else")
