"""`swarmwire ui`."""

import os
from pathlib import Path
from typing import Annotated

import typer

from swarmwire.comms.clock import WallClock
from swarmwire.comms.errors import BadInput
from swarmwire.deploy.commands.with_parent import WithParent, standard_input_closed


def ui_command(
    run: Annotated[Path, typer.Argument(help="The folder of a run that goes on.", metavar="RUN")],
    port: Annotated[int | None, typer.Option(help="Port of the page. Default: a free one.", min=1, max=65535)] = None,
    with_parent: WithParent = False,
) -> None:
    """Open the page of a run that goes on: look at it, pause and step it, break and mend it. Ctrl-C ends the page.

    The page is for browsers of this machine alone, and lets in whoever has its address with the token in it.
    """
    # Imported here: rerun, zenoh and the web server take a second, which --help and typing errors should not.
    from swarmwire.deploy.page.extra import need_ui_extra
    from swarmwire.metrics.viewer.extra import need_view_extra

    need_ui_extra("ui")
    need_view_extra("ui")
    from swarmwire.deploy.interrupt import Interrupt
    from swarmwire.deploy.live.live_file import read_live
    from swarmwire.deploy.live.showing import Way
    from swarmwire.deploy.page.showing_page import show_page

    os.environ.setdefault("RUST_LOG", "off")  # rerun's library tells of each viewer that is closed, as an error
    live = read_live(run) if run.is_dir() else None
    if live is None:
        raise BadInput(str(run), "", "expected the folder of a run that goes on")
    with Interrupt() as interrupt:
        way = Way(
            clock=WallClock(),
            say=lambda text: typer.echo(text, err=True),
            stopped=lambda: interrupt.asked or (with_parent and standard_input_closed()),
            port=port,
        )
        show_page(live, way)
