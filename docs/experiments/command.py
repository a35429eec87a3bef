"""What the pages' commands share: an error is one line, and its exit code that of `swarmwire`."""

import sys

import typer

from swarmwire.comms.errors import BadInput, Interrupted, SwarmwireError
from swarmwire.deploy.cli.app import let_help_flow
from swarmwire.deploy.cli.options import BAD_INPUT, FAILED, INTERRUPTED


def run_app(app: typer.Typer) -> None:
    """Run what the arguments say; every error of ours is one line."""
    let_help_flow(app)
    try:
        app()
    except SwarmwireError as error:
        typer.echo(f"error: {error}", err=True)
        sys.exit(_exit_code_of(error))


def _exit_code_of(error: SwarmwireError) -> int:
    if isinstance(error, BadInput):
        return BAD_INPUT
    return INTERRUPTED if isinstance(error, Interrupted) else FAILED
