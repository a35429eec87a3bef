"""`swarmwire ui`: the page of a live run."""

from swarmwire.deploy.cli.actions.control import operator_network
from swarmwire.deploy.cli.actions.view import view_options
from swarmwire.deploy.cli.options import RunChoice
from swarmwire.deploy.live.page.server import show_page
from swarmwire.deploy.live.remote_control import only_run_at
from swarmwire.deploy.runs.controls import Interrupt
from swarmwire.deploy.runs.live_address import Live, find_run

NO_PROCESS = 0  # process id of a run on another machine


def open_page(choice: RunChoice, *, port: int | None, with_parent: bool) -> None:
    """Serve the page of a live run until it is over and closed."""
    network = operator_network(choice)
    if choice.endpoint is None:
        live: Live = find_run(choice.run)
    else:
        live = Live(choice.endpoint, choice.run or only_run_at(choice.endpoint, network), NO_PROCESS)
    with Interrupt() as interrupt:
        show_page(live, view_options(interrupt, port=port, with_parent=with_parent), network, begin=with_parent)
