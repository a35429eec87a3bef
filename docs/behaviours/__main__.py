"""`python -m docs.behaviours`: makes the pictures and figures of the pages beside it."""

from typing import Annotated

import typer
from rich.console import Console

from docs.behaviours.degradation import degradation_of
from docs.behaviours.shown import LAYOUT, draw_picture, find_shown, names
from docs.experiments.making import draw, run, run_app
from swarmwire.deploy.campaigns.sweep import ExecutionOptions
from swarmwire.deploy.terminal.output import echo, flowing

ABOUT = """The pages in docs/behaviours: a picture of each behaviour, and its performance under loss and latency.

A behaviour NAME is run by scenarios/behaviours/NAME.toml and swept by scenarios/behaviours/campaigns/NAME.toml;
docs/behaviours/shown.py says what of them is drawn. Swept campaigns lie in campaigns/behaviours, their digests in
docs/behaviours/data.
"""
app = typer.Typer(no_args_is_help=True, add_completion=False, pretty_exceptions_enable=False, help=flowing(ABOUT))
Names = Annotated[
    list[str] | None, typer.Argument(help="Behaviours, as `list` has them; all without.", metavar="NAME…")
]
Workers = Annotated[int | None, typer.Option(help="Worker processes of a sweep. Default: one for each core.")]


@app.command("list")
def list_command() -> None:
    """Name the behaviours, with what is measured of each."""
    for name in names(LAYOUT):
        echo(f"{name}: {find_shown(name, LAYOUT).title}")


@app.command("picture")
def picture_command(chosen: Names = None) -> None:
    """Run the scenario and draw it, with the ways of the robots."""
    for name in chosen or names(LAYOUT):
        echo(f"drawn: {draw_picture(name, LAYOUT)}")


@app.command("degrade")
def degrade_command(chosen: Names = None, workers: Workers = None) -> None:
    """Sweep the missing runs of the campaign, digest it, draw the figure, and print its numbers."""
    for name in chosen or names(LAYOUT):
        options = ExecutionOptions(workers=workers)
        echo(run(degradation_of(name, LAYOUT), LAYOUT, None, options, Console(highlight=False)))


@app.command("draw")
def draw_command(chosen: Names = None) -> None:
    """Draw the figure from the existing digest, and print its numbers."""
    for name in chosen or names(LAYOUT):
        echo(draw(degradation_of(name, LAYOUT), LAYOUT))


@app.command("all")
def all_command(chosen: Names = None, workers: Workers = None) -> None:
    """Make the pictures and figures of the pages."""
    picture_command(chosen)
    degrade_command(chosen, workers)


if __name__ == "__main__":
    run_app(app)
