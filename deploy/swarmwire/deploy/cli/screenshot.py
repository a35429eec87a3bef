"""`swarmwire screenshot`."""

from pathlib import Path
from typing import Annotated

import typer

from swarmwire.metrics.run_folder.layout import RECORDING


def screenshot_command(
    recording: Annotated[Path, typer.Argument(help="A run folder, or its run.rrd.", metavar="RUN")],
    to: Annotated[Path, typer.Option(help="The PNG to write.")],
    tick: Annotated[int | None, typer.Option(help="The tick to show. Default: the last.")] = None,
) -> None:
    """Draw a recording as rerun's viewer shows it, without a screen. Needs a Vulkan driver; Mesa's will do."""
    from swarmwire.metrics.viewer.screenshot import render_png

    render_png(recording / RECORDING if recording.is_dir() else recording, to, tick)
    typer.echo(f"written: {to}")
