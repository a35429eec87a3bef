"""`swarmwire view`."""

import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from swarmwire.comms.clock import WallClock
from swarmwire.comms.errors import BadInput
from swarmwire.comms.extras import VIEW
from swarmwire.deploy.cli.with_parent import WithParent, standard_input_closed
from swarmwire.metrics.run_folder.layout import RECORDING

if TYPE_CHECKING:
    from swarmwire.deploy.live.showing import RadioModel


def view_command(
    run: Annotated[Path, typer.Argument(help="A run folder, or a recording (.rrd).", metavar="RUN")],
    web: Annotated[bool, typer.Option("--web", help="In a browser, also if there is a screen.")] = False,
    port: Annotated[
        int | None, typer.Option(help="Port of the pages for a browser. Default: a free one.", min=1, max=65535)
    ] = None,
    with_parent: WithParent = False,
) -> None:
    """Look at a run: live while it goes on, its recording afterwards. Ctrl-C, or closing the window, ends the view.

    Opens a window if there is a screen; else prints an address for a browser on this machine.
    """
    # Imported here: rerun and zenoh take a second, which --help and typing errors should not.
    from swarmwire.deploy.interrupt import Interrupt
    from swarmwire.deploy.live.showing import RadioModel
    from swarmwire.deploy.live.viewer_program import has_screen

    VIEW.need("view")
    os.environ.setdefault("RUST_LOG", "off")  # rerun's library tells of each viewer that is closed, as an error
    with Interrupt() as interrupt:
        way = RadioModel(
            clock=WallClock(),
            say=lambda text: typer.echo(text, err=True),
            stopped=lambda: interrupt.asked or (with_parent and standard_input_closed()),
            web=web or port is not None or not has_screen(),
            port=port,
        )
        _show(run, way)


def _show(run: Path, way: "RadioModel") -> None:
    """Show a run that goes on; if it is over by now, or was before, its recording."""
    from swarmwire.deploy.live.following import RunGone
    from swarmwire.deploy.live.live_file import read_live
    from swarmwire.deploy.live.showing import show_live, show_recording

    live = read_live(run) if run.is_dir() else None
    recording = run / RECORDING if run.is_dir() else run
    if live is not None:
        try:
            show_live(live, way)
        except RunGone:
            if not recording.is_file():
                raise
        else:
            return
    if not recording.is_file():
        raise BadInput(str(run), "", f"expected a run folder with {RECORDING} or a run that goes on, or a recording")
    show_recording(recording, way)
