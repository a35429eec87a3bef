"""`swarmwire view` and `ui`: look at a run, and control it in a browser."""

import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from swarmwire.comms.base.clock import WallClock
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.base.extras import UI, VIEW
from swarmwire.deploy.cli.ctl import RunChoice
from swarmwire.deploy.cli.options import (
    Certs,
    Endpoint,
    Insecure,
    Name,
    Port,
    WithParent,
    standard_input_closed,
)
from swarmwire.deploy.terminal.output import echo

if TYPE_CHECKING:
    from swarmwire.deploy.live.viewer import ViewOptions


def view_command(
    run: Annotated[Path, typer.Argument(help="A run folder, or a recording (.rrd).", metavar="RUN")],
    web: Annotated[bool, typer.Option("--web", help="In a browser, also if there is a screen.")] = False,
    port: Port = None,
    with_parent: WithParent = False,
) -> None:
    """Show a run: live, or its recording afterwards. Ctrl-C, or closing the window, ends the view.

    Opens a window if there is a screen; otherwise prints a URL for a browser on this machine.
    """
    # Imported here: rerun and zenoh take a second, which --help and typing errors should not.
    from swarmwire.deploy.live.viewer import ViewOptions, has_screen
    from swarmwire.deploy.runs.controls import Interrupt

    VIEW.need("view")
    in_browser = web or port is not None or not has_screen()
    if in_browser:
        UI.need("view --web")
    os.environ.setdefault("RUST_LOG", "off")  # rerun's library tells of each viewer that is closed, as an error
    with Interrupt() as interrupt:
        options = ViewOptions(
            clock=WallClock(),
            say=lambda text: echo(text, err=True),
            stopped=lambda: interrupt.requested or (with_parent and standard_input_closed()),
            web=in_browser,
            port=port,
        )
        _show(run, options)


def _show(run: Path, options: "ViewOptions") -> None:
    """Show a run that goes on; if it is over by now, or was before, its recording."""
    from swarmwire.deploy.live.following import RunGone
    from swarmwire.deploy.live.viewer import show_live, show_recording
    from swarmwire.deploy.runs.live_address import read_live
    from swarmwire.metrics.records.run_folder.layout import RECORDING

    live = read_live(run) if run.is_dir() else None
    recording = run / RECORDING if run.is_dir() else run
    if live is not None:
        try:
            show_live(live, options)
        except RunGone:
            if not recording.is_file():
                raise
        else:
            return
    if not recording.is_file():
        raise BadInput(str(run), "", f"expected a run folder with {RECORDING} or a live run, or a recording")
    show_recording(recording, options)


ELSEWHERE = 0  # in place of a process of this machine


def ui_command(
    run: Annotated[
        str | None,
        typer.Argument(help="The id of a live run, or its folder. Default: the only live run.", metavar="RUN"),
    ] = None,
    endpoint: Endpoint = None,
    certs: Certs = None,
    name: Name = None,
    insecure: Insecure = False,
    port: Port = None,
    with_parent: WithParent = False,
) -> None:
    """Open the page of a live run: watch, pause and step it, inject and clear faults.

    The page ends at Ctrl-C, or once the run is over and all browsers have closed it. It is for browsers of this machine
    only; its URL contains the access token.
    """
    UI.need("ui")
    VIEW.need("ui")
    # Imported here: rerun, zenoh and the web server take a second, which --help and typing errors should not.
    from swarmwire.deploy.live.page.server import show_page
    from swarmwire.deploy.live.remote_control import find_run, only_run_at
    from swarmwire.deploy.live.viewer import ViewOptions
    from swarmwire.deploy.runs.controls import Interrupt
    from swarmwire.deploy.runs.live_address import Live

    os.environ.setdefault("RUST_LOG", "off")  # rerun's library tells of each viewer that is closed, as an error
    chosen = RunChoice(run, endpoint, certs, name, insecure)
    network = chosen.network()
    if endpoint is None:
        found = find_run(run)
        live = Live(found.endpoint, found.run, found.pid)
    else:
        live = Live(endpoint, run or only_run_at(endpoint, network), ELSEWHERE)
    with Interrupt() as interrupt:
        options = ViewOptions(
            clock=WallClock(),
            say=lambda text: echo(text, err=True),
            stopped=lambda: interrupt.requested or (with_parent and standard_input_closed()),
            port=port,
        )
        show_page(live, options, network, begin=with_parent)
