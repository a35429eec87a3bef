"""`swarmwire certs list`."""

import json
from collections.abc import Sequence
from typing import TYPE_CHECKING

import typer
from msgspec import to_builtins

from swarmwire.comms.clock import WallClock
from swarmwire.deploy.cli.certs.options import AuthorityFolder
from swarmwire.deploy.cli.options import AsJson

if TYPE_CHECKING:
    from swarmwire.deploy.certificates.register import Issued

COLUMNS = ("name", "for", "addresses", "serial", "valid until", "state")
ENDING = ("ends soon", "ended")
SERIAL_DIGITS = 12  # of up to 40, which --json tells


def list_issued_command(folder: AuthorityFolder, as_json: AsJson = False) -> None:
    """List certificates, and warn of those that end within 30 days.

    For example:

      swarmwire certs list lab-ca
    """
    from swarmwire.deploy.certificates.register import Register, date_now

    states = list(Register.read(folder).states(date_now(WallClock())))
    if as_json:
        typer.echo(json.dumps([to_builtins(of) | {"state": state} for of, state in states], indent=2))
        return
    _print(states)
    ending = [of.name for of, state in states if state in ENDING]
    if states[0][1] in ENDING:
        typer.echo(f"warning: all must be renewed with their CA: swarmwire certs init --renew {folder}", err=True)
    elif ending:
        typer.echo(f"warning: to be renewed: swarmwire certs issue {folder} {' '.join(ending)}", err=True)


def _print(states: "Sequence[tuple[Issued, str]]") -> None:
    from rich.console import Console

    from swarmwire.deploy.certificates.register import text_of
    from swarmwire.deploy.terminal.rows import print_rows

    rows = [
        (of.name, of.purpose, " ".join(of.hosts), of.serial[:SERIAL_DIGITS], text_of(of.valid_until), state)
        for of, state in states
    ]
    print_rows(COLUMNS, rows, Console(highlight=False))
