"""`swarmwire ui`."""

import os
from typing import Annotated

import typer

from swarmwire.comms.clock import WallClock
from swarmwire.comms.extras import UI, VIEW
from swarmwire.deploy.cli.access_options import Ca, Certificate, Certs, Insecure, Key, Name
from swarmwire.deploy.cli.ctl.chosen_run import Chosen, Endpoint
from swarmwire.deploy.cli.with_parent import WithParent, standard_input_closed

ELSEWHERE = 0  # in place of a process of this machine


def ui_command(
    run: Annotated[
        str | None,
        typer.Argument(
            help="The id of a run that goes on, or its folder. Default: the only one there is.", metavar="RUN"
        ),
    ] = None,
    endpoint: Endpoint = None,
    certs: Certs = None,
    name: Name = None,
    ca: Ca = None,
    certificate: Certificate = None,
    key: Key = None,
    insecure: Insecure = False,
    port: Annotated[int | None, typer.Option(help="Port of the page. Default: a free one.", min=1, max=65535)] = None,
    with_parent: WithParent = False,
) -> None:
    """Open the page of a run that goes on: look at it, pause and step it, break and mend it. Ctrl-C ends the page.

    The page is for browsers of this machine alone, and lets in whoever has its address with the token in it.
    """
    UI.need("ui")
    VIEW.need("ui")
    # Imported here: rerun, zenoh and the web server take a second, which --help and typing errors should not.
    from swarmwire.deploy.control.remote_control import only_run_at
    from swarmwire.deploy.control.run_finder import find_run
    from swarmwire.deploy.interrupt import Interrupt
    from swarmwire.deploy.live.live_file import Live
    from swarmwire.deploy.live.showing import RadioModel
    from swarmwire.deploy.page.showing_page import show_page

    os.environ.setdefault("RUST_LOG", "off")  # rerun's library tells of each viewer that is closed, as an error
    chosen = Chosen(run, endpoint, certs, name, (ca, certificate, key), insecure)
    network = chosen.network()
    if endpoint is None:
        found = find_run(run)
        live = Live(found.endpoint, found.run, found.pid)
    else:
        live = Live(endpoint, run or only_run_at(endpoint, network), ELSEWHERE)
    with Interrupt() as interrupt:
        way = RadioModel(
            clock=WallClock(),
            say=lambda text: typer.echo(text, err=True),
            stopped=lambda: interrupt.asked or (with_parent and standard_input_closed()),
            port=port,
        )
        show_page(live, way, network, begin=with_parent)
