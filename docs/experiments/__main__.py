"""`python -m docs.experiments`: lists, runs, digests and draws the experiments on the pages beside it."""

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from docs.experiments.experiment import LAYOUT, find_experiment, names
from docs.experiments.making import digest, draw, run, run_app
from swarmwire.deploy.campaigns.sweep import ExecutionOptions
from swarmwire.deploy.terminal.output import echo, flowing

ABOUT = """The experiments in docs/experiments: campaigns, and what is drawn and told of them.

An experiment NAME is described by docs/experiments/figures/NAME.py: which campaigns of scenarios/papers it needs, which
columns of them are kept in docs/experiments/data, how its figure is drawn and its numbers are told. Try one with few
seeds first: `python -m docs.experiments run NAME --seeds 2`.
"""
app = typer.Typer(no_args_is_help=True, add_completion=False, pretty_exceptions_enable=False, help=flowing(ABOUT))
Name = Annotated[str, typer.Argument(help="The experiment, as `list` has it.", metavar="NAME")]


@app.command("list")
def list_command() -> None:
    """Name the experiments, with their campaigns."""
    for name in names(LAYOUT):
        experiment = find_experiment(name, LAYOUT)
        echo(f"{name}: {experiment.about}")
        echo(f"    {', '.join(experiment.campaigns)}")


@app.command("draw")
def draw_command(
    chosen: Annotated[list[str] | None, typer.Argument(help="Experiments; all without.", metavar="NAME…")] = None,
) -> None:
    """Draw NAME.svg from the digests that are there, and put the numbers into NAME.md."""
    for name in chosen or names(LAYOUT):
        experiment = find_experiment(name, LAYOUT)
        echo(draw(experiment, LAYOUT))
        echo(f"drawn: {LAYOUT.figure_of(experiment.name)}")


@app.command("digest")
def digest_command(
    name: Name,
    folders: Annotated[
        list[Path] | None,
        typer.Argument(
            help="Campaigns' folders, each named as its campaign. Without: those in campaigns/papers.",
            metavar="FOLDER…",
        ),
    ] = None,
) -> None:
    """Keep of finished campaigns what the figure and the numbers are made from."""
    for file in digest(find_experiment(name, LAYOUT), LAYOUT, folders or ()):
        echo(f"written: {file}")


@app.command("run")
def run_command(
    name: Name,
    seeds: Annotated[
        str | None,
        typer.Option(
            help="Other seeds than the campaigns' own: 2 (1 and 2), 4:10 (4 to 9) or 1,5,7. All that is made goes to "
            "campaigns/papers/seeds-…, and the page stays as it is."
        ),
    ] = None,
    workers: Annotated[int | None, typer.Option(help="Worker processes. Default: one for each core.")] = None,
) -> None:
    """Sweep, digest and draw: all that stands on the page, from nothing.

    Campaigns lie in campaigns/papers. One that is finished is not run again; of one that was ended, by Ctrl-C or a
    kill, what is missing is run.
    """
    console = Console(highlight=False)
    echo(run(find_experiment(name, LAYOUT), LAYOUT, seeds, ExecutionOptions(workers=workers), console))


if __name__ == "__main__":
    run_app(app)
