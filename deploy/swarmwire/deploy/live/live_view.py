"""The live view or page of a run that this process executes: a viewing process beside it, which cannot disturb it."""

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

LEAVE_S = 8.0  # how long the viewing process may take to end its viewer


class LiveView(Observer):
    """Observer that opens a view of the run in this folder, which must be published before it begins.

    As a context manager it ends the viewing process and all that this started. Nothing here raises into a run: a view
    that does not open says so on the terminal.
    """

    def __init__(
        self,
        folder: Path,
        web: bool = False,
        *,
        page: bool = False,
        say: Callable[[str], None] | None = None,
        closed: Callable[[], None] | None = None,
    ) -> None:
        """View the run in a window if there is a screen, else, or with `web`, in a browser.

        With `page` it is the page, for a browser. What the view says goes to `say`, line by line, or to the terminal;
        `closed` is called when its process has ended, whatever ended it. Both are called in a thread of their own.
        """
        name = "ui" if page else "view"
        self._command = [sys.executable, "-m", "swarmwire.deploy", name, str(folder), "--with-parent", *["--web"] * web]
        self._say, self._closed = say, closed
        self._process: subprocess.Popen[bytes] | None = None

    def __enter__(self) -> "LiveView":
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.close()

    @property
    def pid(self) -> int | None:
        """The viewing process, once it was started."""
        return None if self._process is None else self._process.pid

    def begin(self, static: Static) -> None:
        """Start the viewing process."""
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
        try:
            # A session of its own: Ctrl-C is for the run. Its standard input tells it when this process is gone.
            self._process = subprocess.Popen(
                self._command,
                stdin=subprocess.PIPE,
                stderr=subprocess.PIPE if self._say else None,
                env=environment,
                start_new_session=True,
            )
        except OSError as error:
            print(f"no live view: {error}", file=sys.stderr, flush=True)
            if self._closed:
                self._closed()
            return
        if self._say or self._closed:
            threading.Thread(target=self._attend, args=(self._process,), name="live view", daemon=True).start()

    def _attend(self, process: subprocess.Popen[bytes]) -> None:
        if self._say and process.stderr:
            with process.stderr as lines:
                for line in lines:
                    self._say(line.decode(errors="replace").rstrip())
        process.wait()
        if self._closed:
            self._closed()

    def wait(self) -> None:
        """Return when the person has closed the view, at once if there is none; Ctrl-C ends the wait and the view."""
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
            process.wait(LEAVE_S)
        with suppress(ProcessLookupError, PermissionError):  # also a viewer whose parent was killed
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()


SPEED = 1.0  # simulated s per s of wall time at which a run that need not keep to the wall clock begins


class PageBeside(LiveView):
    """Observer that opens the page of a run, and has the run begin paused, at a speed that people can follow."""

    def __init__(self, simulation: Simulation, folder: Path, console: Console) -> None:
        """What the page says, above all its address, goes above the terminal's panel."""
        say = None if console.quiet else self._print
        super().__init__(folder, page=True, say=say, closed=self._gone)
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
        """The run is over; the page stays."""
        self._over = True
        return super().end(last)

    def _print(self, text: str) -> None:
        self._console.print(text, markup=False, soft_wrap=True)

    def _gone(self) -> None:
        controls = self._simulation.controls
        if self._simulation.tick <= 1:  # it never came to be used, so nobody will press play
            controls.resume()
        elif not self._over:
            held = "paused: swarmwire ctl resume continues it" if controls.paused else "running"
            self._print(f"the page has ended, the run is {held}; swarmwire ui opens another page")
