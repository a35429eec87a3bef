"""The live view or page of a run in this process: a separate viewing process, which cannot disturb the run."""

import os
import signal
import subprocess
import sys
import threading
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Any

from rich.console import Console

from swarmwire.comms.observe.interfaces import Observer
from swarmwire.comms.observe.truth import Static
from swarmwire.comms.radio.records import PacketCounts
from swarmwire.deploy.runs.simulation import Simulation

EXIT_TIMEOUT_S = 8.0  # limit for the viewing process to end its viewer


class LiveView(Observer):
    """Observer that opens a view of the run in a folder; the run must be published before the first tick.

    At its end, the context manager ends the viewing process and its child processes. It never raises into a run: a
    view that does not open prints a line on the terminal.
    """

    def __init__(
        self,
        folder: Path,
        web: bool = False,
        *,
        page: bool = False,
        report: Callable[[str], None] | None = None,
        closed: Callable[[], None] | None = None,
    ) -> None:
        """View the run in a window if there is a screen, else, or with `web`, in a browser.

        `page` selects the web page. `report` gets the lines that the view prints, by default the terminal does;
        `closed` is called when its process has ended for any reason. Both are called in a separate thread.
        """
        name = "ui" if page else "view"
        self._command = [sys.executable, "-m", "swarmwire.deploy", name, str(folder), "--with-parent", *["--web"] * web]
        self._report, self._closed = report, closed
        self._process: subprocess.Popen[bytes] | None = None

    def __enter__(self) -> "LiveView":
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.close()

    @property
    def pid(self) -> int | None:
        """Id of the viewing process, once it was started."""
        return None if self._process is None else self._process.pid

    def begin(self, static: Static) -> None:
        """Start the viewing process."""
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
        try:
            # A separate session, since Ctrl-C is for the run. The end of standard input ends it with this process.
            self._process = subprocess.Popen(
                self._command,
                stdin=subprocess.PIPE,
                stderr=subprocess.PIPE if self._report else None,
                env=environment,
                start_new_session=True,
            )
        except OSError as error:
            print(f"no live view: {error}", file=sys.stderr, flush=True)
            if self._closed:
                self._closed()
            return
        if self._report or self._closed:
            threading.Thread(target=self._attend, args=(self._process,), name="live view", daemon=True).start()

    def _attend(self, process: subprocess.Popen[bytes]) -> None:
        if self._report and process.stderr:
            with process.stderr as lines:
                for line in lines:
                    self._report(line.decode(errors="replace").rstrip())
        process.wait()
        if self._closed:
            self._closed()

    def wait(self) -> None:
        """Wait until the user has closed the view; Ctrl-C ends the wait and the view."""
        if self._process is None:
            return
        try:
            self._process.wait()
        except KeyboardInterrupt:
            self.close()

    def close(self) -> None:
        """End the view; safe to call more than once."""
        process, self._process = self._process, None
        if process is None:
            return
        if process.stdin is not None:
            process.stdin.close()
        with suppress(subprocess.TimeoutExpired):
            process.wait(EXIT_TIMEOUT_S)
        with suppress(ProcessLookupError, PermissionError):  # includes a viewer whose parent was killed
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()


SPEED = 1.0  # initial speed of a run without real time, in simulated s per s of wall time


class PageBeside(LiveView):
    """Observer that opens the page of a run, which begins paused and at the speed of real time."""

    def __init__(self, simulation: Simulation, folder: Path, console: Console) -> None:
        """Print the page's lines, such as its address, above the terminal's panel."""
        report = None if console.quiet else self._print
        super().__init__(folder, page=True, report=report, closed=self._on_closed)
        self._simulation, self._console = simulation, console
        self._over = False

    def begin(self, static: Static) -> None:
        """Pause the run before its first tick, and start the page's process."""
        controls = self._simulation.controls
        controls.pause()
        if not controls.real_time:
            controls.set_speed(SPEED)
        super().begin(static)

    def end(self, last: PacketCounts | None) -> dict[str, Any]:
        """Note the end of the run; the page stays open."""
        self._over = True
        return super().end(last)

    def _print(self, text: str) -> None:
        self._console.print(text, markup=False, soft_wrap=True)

    def _on_closed(self) -> None:
        controls = self._simulation.controls
        if self._simulation.tick <= 1:  # the page was not used, so no user will resume the run
            controls.resume()
        elif not self._over:
            state = "paused: swarmwire ctl resume continues it" if controls.paused else "running"
            self._print(f"the page has ended, the run is {state}; swarmwire ui opens another page")
