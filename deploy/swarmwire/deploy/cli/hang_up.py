"""The end of a command whose terminal is gone."""

from collections.abc import Generator
from contextlib import contextmanager

import typer

from swarmwire.comms.errors import Interrupted
from swarmwire.deploy.cli.exit_codes import HUNG_UP
from swarmwire.deploy.interrupt import Interrupt


@contextmanager
def leaving_when_hung_up(interrupt: Interrupt) -> Generator[None]:
    """Leave the command after the block if SIGHUP came in it, without a word: to print would fail."""
    try:
        yield
    except Interrupted:  # before the first tick
        if not interrupt.hung_up:
            raise
    if interrupt.hung_up:
        raise typer.Exit(HUNG_UP)
