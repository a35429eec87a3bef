"""Rerun's viewer in a separate process, in a window or a browser, with a recording or a live run."""

import os
import subprocess
import sys
from collections.abc import Callable, Generator, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory, TemporaryFile
from typing import IO

from swarmwire.comms.base.clock import NS_PER_S, Clock
from swarmwire.comms.base.errors import BadInput, SwarmwireError
from swarmwire.metrics.pictures.viewer.program import (
    Target,
    closed_environment,
    end,
    ending_with_this,
    free_port,
    hidden_loopback,
    is_open,
    viewer_path,
)
from swarmwire.metrics.records.run_folder.layout import complete_frames_bytes

POLL_NS = NS_PER_S // 100
START_TIMEOUT_NS = 30 * NS_PER_S  # limit until rerun listens
START_POLL_NS = NS_PER_S // 20
RELOAD_TIMEOUT_NS = 5 * NS_PER_S  # limit for a browser to reload its page
LIVE_MEMORY = "2GB"  # memory of the live view; beyond it the oldest ticks are dropped
HEAD = b"RRF2"  # first bytes of a recording


@dataclass(frozen=True)
class Viewer:
    """A viewer on this machine, out of reach of other machines."""

    target: Target  # destination of drawings
    address: str | None  # address for a browser, with a token; None: the viewer has a window
    alive: Callable[[], bool]  # False once its window is closed
    abandoned: Callable[[], bool] = lambda: False  # True if browsers showed it, and all have closed it


class AbandonmentDetector:
    """Detects that all readers have left for longer than a browser needs to reload a page."""

    def __init__(self, clock: Clock, readers: Callable[[], int]) -> None:
        """`readers` returns the present number of readers; this object must be called often."""
        self._clock, self._readers = clock, readers
        self._last_ns: int | None = None  # time of the last reader; None: no reader yet

    def __call__(self) -> bool:
        """Return True if there were readers, and all have left."""
        now_ns = self._clock.now_ns()
        if self._readers():
            self._last_ns = now_ns
        return self._last_ns is not None and now_ns - self._last_ns > RELOAD_TIMEOUT_NS


@contextmanager
def window(clock: Clock, recording: Path | None) -> Generator[Viewer]:
    """Open a window with this recording, or for a live run; it is closed after the block."""
    options = ["--hide-welcome-screen"]
    options += ["--memory-limit", LIVE_MEMORY, "--server-memory-limit", LIVE_MEMORY] if recording is None else []
    with rerun(clock, [*options, *([str(recording)] if recording else [])]) as (process, host, ports):
        yield Viewer(f"rerun+http://{host}:{ports[0]}/proxy", None, lambda: process.poll() is None)


@contextmanager
def rerun(
    clock: Clock, options: Sequence[str], *, web: bool = False
) -> Generator[tuple["subprocess.Popen[bytes]", str, Sequence[int]]]:
    """Start rerun's program with these options; yield process, host and ports once it listens, and end it afterwards.

    The ports are for data and, with `web`, for its pages.
    """
    host = hidden_loopback()
    ports = [free_port(host) for _ in range(1 + web)]
    listening = ["--bind", host, "--port", str(ports[0])]
    listening += ["--serve-web", "--web-viewer-port", str(ports[1])] if web else []
    with TemporaryFile() as log:  # without a name, so that no file remains if this process is killed
        command = ending_with_this([str(viewer_path()), *listening, *options])
        environment = {**closed_environment(), "RUST_LOG": "warn"}
        process = subprocess.Popen(command, env=environment, stdout=log, stderr=log)
        try:
            deadline_ns = clock.now_ns() + START_TIMEOUT_NS
            while not all(is_open(port, host) for port in ports):
                if process.poll() is not None or clock.now_ns() > deadline_ns:
                    hint = "" if web else "; --web shows the run in a browser"
                    raise SwarmwireError(f"rerun's viewer did not start{hint}\n{_end_of(log)}")
                clock.sleep_until(clock.now_ns() + START_POLL_NS)
            yield process, host, ports
        finally:
            end(process)


def _end_of(log: IO[bytes]) -> str:
    log.seek(0)
    return log.read().decode(errors="replace")[-2000:].strip()


def has_screen() -> bool:
    """Return True if this machine can open a window."""
    return sys.platform == "darwin" or any(os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY"))


@contextmanager
def readable(recording: Path) -> Generator[Path]:
    """Yield the recording, or a repaired temporary copy; BadInput if it has no tick."""
    if not recording.is_file():
        raise BadInput(str(recording), "", "expected a recording, which does not exist")
    with recording.open("rb") as file:
        head = file.read(len(HEAD))
    if head != HEAD:
        raise BadInput(str(recording), "", "expected a recording (.rrd) with at least a tick in it")
    if complete_frames_bytes(recording) == recording.stat().st_size:
        yield recording
        return
    with TemporaryDirectory(prefix="swarmwire-view-") as directory:
        copy = Path(directory, recording.name)
        repair = subprocess.run(
            [viewer_path(), "rrd", "optimize", recording, "-o", copy],
            env=closed_environment(),
            capture_output=True,
            text=True,
            check=False,
        )
        if repair.returncode or not copy.is_file():
            raise BadInput(str(recording), "", f"expected a recording that can be read: {repair.stderr[-500:].strip()}")
        yield copy


@dataclass(frozen=True)
class ViewOptions:
    """Options of a view."""

    clock: Clock
    report: Callable[[str], None]  # prints a line for the user
    stopped: Callable[[], bool]  # True once the user ends the view
    web: bool = False  # pages for a browser instead of a window
    port: int | None = None  # port of the pages; None: any free port

    def viewer(self, recording: Path | None) -> AbstractContextManager[Viewer]:
        """Return the viewer, with this recording or for a live run."""
        if not self.web:
            return window(self.clock, recording)
        from swarmwire.deploy.live.page.web_viewer import web_viewer  # needs the extra [ui]

        return web_viewer(self.clock, recording, self.port)

    def pause(self) -> None:
        """Wait until the next poll."""
        self.clock.sleep_until(self.clock.now_ns() + POLL_NS)


def show_recording(recording: Path, options: ViewOptions) -> None:
    """Show a recording, also of a run that was killed, until the viewer is closed or `options.stopped()`."""
    with readable(recording) as complete, options.viewer(complete) as viewer:
        report_address(viewer, options)
        while viewer.alive() and not options.stopped():
            options.pause()


def report_address(viewer: Viewer, options: ViewOptions) -> None:
    """Print the address for a browser, if the viewer has one."""
    if viewer.address is not None:
        options.report(f"open {viewer.address} in a browser; Ctrl-C ends the view")
