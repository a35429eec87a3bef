"""Plain output to people. Names and messages come from files and other machines, so every text is made printable."""

import typer

from swarmwire.comms.base.printable import LINES, printable


def echo(text: str, *, err: bool = False, nl: bool = True) -> None:
    """Print a text, of one line or several, to stdout or stderr; `nl` ends the line."""
    typer.echo(printable(text, keep=LINES), err=err, nl=nl)  # noqa: TID251 - for all others
