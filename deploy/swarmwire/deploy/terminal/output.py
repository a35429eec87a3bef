"""Plain output to people. Names and messages come from files and other machines: every text is made printable."""

import typer

from swarmwire.comms.base.printable import LINES, printable


def echo(text: str, *, err: bool = False, nl: bool = True) -> None:
    """Print one or several lines to stdout or stderr; `nl` ends the last line."""
    typer.echo(printable(text, keep=LINES), err=err, nl=nl)  # noqa: TID251 - the only call
