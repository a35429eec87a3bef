"""Rerun's viewer as a process that this one starts and ends: a window of its own, or pages for a browser."""

import os
import subprocess
import sys
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryFile
from typing import IO
from urllib.parse import quote

from swarmwire.comms.clock import NS_PER_S, Clock
from swarmwire.comms.errors import BadInput, SwarmwireError
from swarmwire.metrics.viewer.screenshot import end, ending_with_this, free_port, is_open, program

START_NS = 30 * NS_PER_S  # how long it may take to listen
PAUSE_NS = NS_PER_S // 20
LIVE_MEMORY = "2GB"  # of the live view: then the oldest ticks are dropped


class Viewer:
    """A viewer that listens on this machine alone."""

    def __init__(self, process: "subprocess.Popen[bytes]", port: int, web_port: int | None, log: IO[bytes]) -> None:
        self.process, self._port, self._web_port, self._log = process, port, web_port, log

    @property
    def url(self) -> str:
        """Where it takes what is drawn."""
        return f"rerun+http://127.0.0.1:{self._port}/proxy"

    @property
    def page(self) -> str | None:
        """The address for a browser; None: it has a window."""
        return None if self.web is None else f"{self.web}/?url={quote(self.url, safe='')}"

    @property
    def web(self) -> str | None:
        """The origin of its pages; None: it has a window."""
        return None if self._web_port is None else f"http://127.0.0.1:{self._web_port}"

    @property
    def alive(self) -> bool:
        """Whether it runs: whoever closes the window ends it."""
        return self.process.poll() is None

    def wait(self, clock: Clock) -> None:
        """Return once it listens; SwarmwireError if it does not."""
        until_ns = clock.now_ns() + START_NS
        while not all(is_open(port) for port in (self._port, self._web_port) if port is not None):
            if not self.alive or clock.now_ns() > until_ns:
                raise SwarmwireError(f"rerun's viewer did not start; --web shows the run in a browser\n{self.told}")
            clock.sleep_until(clock.now_ns() + PAUSE_NS)

    @property
    def told(self) -> str:
        """The end of what it printed."""
        self._log.seek(0)
        return self._log.read().decode(errors="replace")[-2000:].strip()


@contextmanager
def viewer(clock: Clock, recording: Path | None, web: bool, web_port: int | None = None) -> Generator[Viewer]:
    """A viewer, with this recording or for what is to come, which has ended after the block."""
    port = free_port()
    if web_port is not None and is_open(web_port):
        raise BadInput("--port", str(web_port), "expected a port that is free")
    page = (web_port or free_port()) if web else None
    options = ["--bind", "127.0.0.1", "--port", str(port)]
    options += ["--serve-web", "--web-viewer-port", str(page)] if page else ["--hide-welcome-screen"]
    limits = ["--memory-limit", LIVE_MEMORY, "--server-memory-limit", LIVE_MEMORY]
    options += limits if recording is None else [str(recording)]
    with TemporaryFile() as log:  # without a name: whoever kills this process leaves none behind
        environment = {**os.environ, "RUST_LOG": "warn", "NO_COLOR": "1"}
        command = ending_with_this([str(program()), *options])
        started = subprocess.Popen(command, env=environment, stdout=log, stderr=log)
        try:
            shown = Viewer(started, port, page, log)
            shown.wait(clock)
            yield shown
        finally:
            end(started)


def has_screen() -> bool:
    """Whether a window can be opened here."""
    return sys.platform == "darwin" or any(os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY"))
