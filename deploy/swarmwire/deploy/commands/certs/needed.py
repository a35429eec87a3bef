"""What the commands of this group share."""

from importlib.util import find_spec
from pathlib import Path
from typing import Annotated

import typer

from swarmwire.comms.errors import SwarmwireError

AuthorityFolder = Annotated[Path, typer.Argument(help="The folder of the CA.", metavar="DIR")]


def need_cryptography() -> None:
    """Return if certificates can be made here; else a SwarmwireError that says what to install."""
    if find_spec("cryptography") is None:
        raise SwarmwireError('certs needs cryptography, which is not installed: pip install "swarmwire[fleet]"')
