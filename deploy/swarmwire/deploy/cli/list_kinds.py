"""`swarmwire list`."""

import json
from dataclasses import asdict
from typing import Annotated

import typer
from rich.console import Console

from swarmwire.deploy.cli.options import AsJson


def list_command(
    kind: Annotated[
        str | None, typer.Argument(help="bodies, sensors, behaviours, events, metrics, …; all kinds if left out.")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """List what a scenario or an agent may name: the kinds, or all things of one kind.

    For example, what may befall robots, and then more about one of these:

      swarmwire list events

      swarmwire describe kill
    """
    # Imported here: pydantic, numba and scipy take a second, which --help should not.
    from swarmwire.deploy.catalogue.kinds import KINDS, kind_named
    from swarmwire.deploy.catalogue.text import print_kinds, print_list

    console = Console(highlight=False)
    found = None if kind is None else kind_named(kind)
    if as_json:
        things = {of.name: [asdict(entry) for entry in of.entries()] for of in ([found] if found else KINDS)}
        typer.echo(json.dumps(things, indent=2))
    elif found:
        print_list(found, console)
    else:
        print_kinds(console)
