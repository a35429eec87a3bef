"""The commands `view` and `ui`: windows and pages of a run."""

from pathlib import Path
from typing import Annotated

import typer

from swarmwire.comms.base.extras import UI, VIEW
from swarmwire.deploy.cli.options import Certs, Endpoint, Insecure, Name, Port, RunChoice, WithParent


def view_command(
    run: Annotated[Path, typer.Argument(help="A run folder, or a recording (.rrd).", metavar="RUN")],
    web: Annotated[bool, typer.Option("--web", help="In a browser, also if there is a screen.")] = False,
    port: Port = None,
    with_parent: WithParent = False,
) -> None:
    """Show a run: live, or its recording afterwards. Ctrl-C, or closing the window, ends the view.

    Opens a window if there is a screen; otherwise prints a URL for a browser on this machine.
    """
    VIEW.need("view")
    from swarmwire.deploy.cli.actions.view import view_run

    view_run(run, web=web, port=port, with_parent=with_parent)


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
    from swarmwire.deploy.cli.actions.view import open_page

    open_page(RunChoice(run, endpoint, certs, name, insecure), port=port, with_parent=with_parent)
