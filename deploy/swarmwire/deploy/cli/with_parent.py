"""The end of a viewing process that belongs to a run: when the run's process has closed its standard input."""

import select
import sys
from typing import Annotated

import typer

WithParent = Annotated[bool, typer.Option("--with-parent", hidden=True, help="End when standard input is closed.")]


def standard_input_closed() -> bool:
    """Whether standard input is at its end; nobody writes to it."""
    return bool(select.select([sys.stdin], [], [], 0)[0])
