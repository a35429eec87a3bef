"""What the pages' commands share: an error is one line, and its exit code that of `swarmwire`."""

import typer

from swarmwire.comms.errors import BadInput, Interrupted, SwarmwireError
from swarmwire.deploy.commands.exit_codes import BAD_INPUT, FAILED, INTERRUPTED


def exit_code_of(error: SwarmwireError) -> int:
    """Say what went wrong; the exit code."""
    typer.echo(f"error: {error}", err=True)
    if isinstance(error, BadInput):
        return BAD_INPUT
    return INTERRUPTED if isinstance(error, Interrupted) else FAILED
