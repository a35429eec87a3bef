"""The process of a command: how people typed it, the exit codes that it ends with, and a terminal that is gone."""

import select
import sys
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from swarmwire.comms.errors import Interrupted

if TYPE_CHECKING:
    from swarmwire.deploy.controls import Interrupt

FAILED = 1  # the run failed: an agent's error, a runner lost
DIFFERENT = 1  # a repetition came out differently, or there is nothing to compare it with
BAD_INPUT = 2
HUNG_UP = 129  # the terminal is gone, with a summary
INTERRUPTED = 130  # Ctrl-C, with a summary


def program() -> Path:
    """This program as people can type it here: it need not be on their path, as with `uv run`."""
    called = Path(sys.argv[0])
    if called.name != "swarmwire":  # python -m
        return Path("swarmwire")
    return called.relative_to(Path.cwd()) if called.is_relative_to(Path.cwd()) else called


@contextmanager
def leaving_when_hung_up(interrupt: "Interrupt") -> Generator[None]:
    """Leave the command after the block if SIGHUP came in it, without a word: to print would fail."""
    try:
        yield
    except Interrupted:  # before the first tick
        if not interrupt.hung_up:
            raise
    if interrupt.hung_up:
        raise typer.Exit(HUNG_UP)


def standard_input_closed() -> bool:
    """Whether standard input is at its end; a view that belongs to a run ends with the run's process."""
    return bool(select.select([sys.stdin], [], [], 0)[0])
