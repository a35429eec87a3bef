"""`swarmwire describe`."""

import json
from dataclasses import asdict
from typing import Annotated

import typer
from rich.console import Console

from swarmwire.deploy.cli.options import AsJson


def describe_command(
    name: Annotated[
        str,
        typer.Argument(help="A name that `swarmwire list` tells, an agent class or a body's sheet of your own."),
    ],
    as_json: AsJson = False,
) -> None:
    """Describe one thing: what it is, its parameters with unit, default and bounds, and where its figures come from.

    For example a body, a key of a scenario, one of two things of the same name, an agent and a body of your own:

      swarmwire describe epuck

      swarmwire describe radio.loss

      swarmwire describe event:blackout

      swarmwire describe my_agent.py:Mine

      swarmwire describe mine.toml
    """
    # Imported here: pydantic, numba and scipy take a second, which --help should not.
    from swarmwire.deploy.catalogue.kinds import find
    from swarmwire.deploy.catalogue.text import print_entry

    entry = find(name)
    if as_json:
        typer.echo(json.dumps(asdict(entry), indent=2))
    else:
        print_entry(entry, Console(highlight=False))
