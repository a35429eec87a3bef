"""`swarmwire view` and `ui`: a run in rerun's viewer, and the page of a live run."""

import os
from pathlib import Path

from swarmwire.comms.base.clock import WallClock
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.base.extras import UI
from swarmwire.deploy.cli.options import RunChoice, standard_input_closed
from swarmwire.deploy.live.viewer import ViewOptions, has_screen, show_recording
from swarmwire.deploy.runs.controls import Interrupt
from swarmwire.deploy.runs.live_address import Live, find_run, read_live
from swarmwire.deploy.terminal.output import echo
from swarmwire.metrics.records.run_folder.layout import RECORDING

NO_PROCESS = 0  # process id of a run on another machine


def view_run(run: Path, *, web: bool, port: int | None, with_parent: bool) -> None:
    """Show a live run or a recording until the view is closed."""
    in_browser = web or port is not None or not has_screen()
    if in_browser:
        UI.need("view --web")
    with Interrupt() as interrupt:
        _show(run, view_options(interrupt, web=in_browser, port=port, with_parent=with_parent))


def open_page(choice: RunChoice, *, port: int | None, with_parent: bool) -> None:
    """Serve the page of a live run until it is over and closed."""
    from swarmwire.deploy.cli.actions.control import operator_network
    from swarmwire.deploy.live.page.server import show_page  # needs the extra [ui]
    from swarmwire.deploy.live.remote_control import only_run_at

    network = operator_network(choice)
    if choice.endpoint is None:
        live: Live = find_run(choice.run)
    else:
        live = Live(choice.endpoint, choice.run or only_run_at(choice.endpoint, network), NO_PROCESS)
    with Interrupt() as interrupt:
        show_page(live, view_options(interrupt, port=port, with_parent=with_parent), network, begin=with_parent)


def view_options(interrupt: Interrupt, *, with_parent: bool, web: bool = False, port: int | None = None) -> ViewOptions:
    """Return the options of a view, which ends at Ctrl-C and, with its parent, when standard input is closed."""
    os.environ.setdefault("RUST_LOG", "off")  # rerun's library logs each viewer that is closed as an error
    return ViewOptions(
        clock=WallClock(),
        report=lambda text: echo(text, err=True),
        stopped=lambda: interrupt.requested or (with_parent and standard_input_closed()),
        web=web,
        port=port,
    )


def _show(run: Path, options: ViewOptions) -> None:
    """Show a live run, or its recording if the run has ended."""
    live = read_live(run) if run.is_dir() else None
    recording = run / RECORDING if run.is_dir() else run
    if live is not None:
        from swarmwire.deploy.live.drawing import show_live
        from swarmwire.deploy.live.subscription import RunGone

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
