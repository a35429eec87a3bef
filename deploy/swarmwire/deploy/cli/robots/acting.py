"""How a command acts on robots: shown while it goes on, then a line for each, and the exit code."""

import asyncio
from collections.abc import Awaitable, Callable, Sequence
from typing import TYPE_CHECKING, TypeVar

import typer
from rich.console import Console

from swarmwire.comms.errors import Interrupted
from swarmwire.deploy.cli.exit_codes import FAILED

if TYPE_CHECKING:
    from swarmwire.deploy.fleet.result import Result, Watcher

T = TypeVar("T")


def act(work: "Callable[[Watcher], Awaitable[T]]") -> T:
    """What the work comes to; Interrupted by Ctrl-C: what is under way is given up, and what is done stays."""
    from swarmwire.deploy.fleet.result import shown_on

    async def run() -> T:
        with shown_on(Console(stderr=True)) as watcher:
            return await work(watcher)

    try:
        return asyncio.run(run())
    except KeyboardInterrupt:
        raise Interrupted("interrupted: robots that were not done are as they were before") from None


def tell(results: "Sequence[Result]") -> None:
    """Print a line per robot; exit code 1 if one of them failed."""
    from swarmwire.deploy.fleet.result import result_lines

    for line in result_lines(results):
        typer.echo(line)
    failed = sum(not result.good for result in results)
    if failed:
        typer.echo(f"{failed} of {len(results)} failed", err=True)
        raise typer.Exit(FAILED)
