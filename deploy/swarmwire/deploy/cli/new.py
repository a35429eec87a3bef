"""`swarmwire new`."""

from pathlib import Path
from typing import Annotated

import typer

from swarmwire.deploy.new_swarm import new_swarm


def new_command(
    name: Annotated[str, typer.Argument(help="The new folder: small letters, digits and _, such as my_swarm.")],
    within: Annotated[Path, typer.Option("--in", help="The folder in which to make it.", metavar="DIR")] = Path(),
) -> None:
    """Make a folder to start from: an agent, a scenario with a lossy radio, a test that passes, and a README.

    For example, and then a first run of it:

      swarmwire new my_swarm

      swarmwire run my_swarm/scenario.toml
    """
    made = new_swarm(name, within)
    folder = made[0].parent
    typer.echo(f"made {folder}: {', '.join(path.name for path in made)}")
    typer.echo(f"run it:    swarmwire run {folder / 'scenario.toml'}")
    typer.echo(f"check it:  swarmwire check {folder / 'scenario.toml'}")
    typer.echo(f"test it:   python -m pytest {folder}")
