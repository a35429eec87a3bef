"""`swarmwire compare`."""

from pathlib import Path
from typing import Annotated

import typer

Campaign = Annotated[str, typer.Argument(help="A campaign's folder; FOLDER@radio.loss=0.4 is that part of it.")]


def compare_command(
    a: Campaign,
    b: Campaign,
    response: Annotated[
        list[str] | None,
        typer.Option(help="A column of responses, or a metric for its last value. Repeatable.", metavar="NAME"),
    ] = None,
    at: Annotated[
        list[str] | None,
        typer.Option(help="Compare where this parameter has this value. Repeatable.", metavar="PATH=VALUE"),
    ] = None,
    to: Annotated[Path | None, typer.Option(help="Write the numbers to this file, too.", metavar="FILE.csv")] = None,
) -> None:
    """Compare two campaigns: medians, their difference and how sure it is, at each design point that both have.

    Points that agree in every parameter that both vary are compared, and seeds that both ran one by one. Unless
    responses are named they are all times, the last values of metrics, and the link PDR. For example:

      swarmwire compare runs/plain runs/smoothed --response order

      swarmwire compare runs/loss@radio.loss=0 runs/loss@radio.loss=0.4
    """
    # Imported here: polars and scipy take a second, which --help should not.
    from rich.console import Console

    from swarmwire.deploy.terminal.tables import print_comparison
    from swarmwire.metrics.campaign.compare import compare, write_comparison
    from swarmwire.metrics.campaign.folder import at as at_points
    from swarmwire.metrics.campaign.folder import select

    first, second = at_points([select(a), select(b)], at or [])
    found = compare(first, second, response or [])
    print_comparison(found, Console(highlight=False))
    if to is not None:
        write_comparison(found, to)
        typer.echo(f"written: {to}")
