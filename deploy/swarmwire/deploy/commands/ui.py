"""`swarmwire ui`."""

import os
from typing import Annotated

import typer

from swarmwire.comms.clock import WallClock
from swarmwire.deploy.commands.with_parent import WithParent, standard_input_closed


def ui_command(
    run: Annotated[
        str | None,
        typer.Argument(
            help="The id of a run that goes on, or its folder. Default: the only one there is.", metavar="[RUN]"
        ),
    ] = None,
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
    from swarmwire.deploy.control.run_finder import find_run
    from swarmwire.deploy.interrupt import Interrupt
    from swarmwire.deploy.live.live_file import Live
    from swarmwire.deploy.live.showing import Way
    from swarmwire.deploy.page.showing_page import show_page

    os.environ.setdefault("RUST_LOG", "off")  # rerun's library tells of each viewer that is closed, as an error
    found = find_run(run)
    with Interrupt() as interrupt:
        way = Way(
            clock=WallClock(),
            say=lambda text: typer.echo(text, err=True),
            stopped=lambda: interrupt.asked or (with_parent and standard_input_closed()),
            port=port,
        )
        show_page(Live(found.endpoint, found.run, found.pid), way)
