"""`swarmwire view`: a run in rerun's viewer."""

import os
from pathlib import Path

from swarmwire.comms.base.clock import WallClock
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.base.extras import UI
from swarmwire.deploy.cli.options import standard_input_closed
from swarmwire.deploy.live.subscription import RunGone
from swarmwire.deploy.live.viewer import ViewOptions, has_screen, show_live, show_recording
from swarmwire.deploy.runs.controls import Interrupt
from swarmwire.deploy.runs.live_address import read_live
from swarmwire.deploy.terminal.output import echo
from swarmwire.metrics.records.run_folder.layout import RECORDING


def view_run(run: Path, *, web: bool, port: int | None, with_parent: bool) -> None:
    """Show a live run or a recording until the view is closed."""
    in_browser = web or port is not None or not has_screen()
    if in_browser:
        UI.need("view --web")
    with Interrupt() as interrupt:
        _show(run, view_options(interrupt, web=in_browser, port=port, with_parent=with_parent))


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
