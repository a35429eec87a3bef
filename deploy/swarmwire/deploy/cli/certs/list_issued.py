"""`swarmwire certs list`."""

import json
from collections.abc import Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING

import typer

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
    from swarmwire.deploy.certificates.dates import date_now
    from swarmwire.deploy.certificates.register import Register

    now, register = date_now(WallClock()), Register.read(folder)
    every = (register.authority, *register.certificates)
    states = [register.state_of(of, now) for of in every]
    if as_json:
        typer.echo(
            json.dumps([asdict(of) | {"state": state} for of, state in zip(every, states, strict=True)], indent=2)
        )
        return
    _print(every, states)
    ending = [of.name for of, state in zip(every, states, strict=True) if state in ENDING]
    if states[0] in ENDING:
        typer.echo(f"warning: all must be renewed with their CA: swarmwire certs init --renew {folder}", err=True)
    elif ending:
        typer.echo(f"warning: to be renewed: swarmwire certs issue {folder} {' '.join(ending)}", err=True)


def _print(every: "Sequence[Issued]", states: list[str]) -> None:
    from rich.console import Console

    from swarmwire.deploy.terminal.rows import print_rows

    rows = [
        (of.name, of.purpose, " ".join(of.hosts), of.serial[:SERIAL_DIGITS], of.valid_until, state)
        for of, state in zip(every, states, strict=True)
    ]
    print_rows(COLUMNS, rows, Console(highlight=False))
