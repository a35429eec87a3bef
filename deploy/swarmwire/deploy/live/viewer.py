"""Rerun's viewer as a process of its own, in a window or a browser: it shows a recording or a live run."""

import os
import subprocess
import sys
import threading
from collections.abc import Callable, Generator, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory, TemporaryFile
from typing import IO

import numpy as np

from swarmwire.comms.base.arrays import FloatArray, IntArray
from swarmwire.comms.base.clock import NS_PER_S, Clock
from swarmwire.comms.base.errors import BadInput, SwarmwireError
from swarmwire.comms.observe.run_views import ObservedTick
from swarmwire.comms.radio.records import PacketCounts
from swarmwire.deploy.live.following import Following, following
from swarmwire.deploy.runs.live_address import Live
from swarmwire.metrics.pictures.viewer.program import (
    closed_environment,
    end,
    ending_with_this,
    free_port,
    hidden_loopback,
    is_open,
    program,
)
from swarmwire.metrics.pictures.viewer.recording import RerunLive, Target
from swarmwire.metrics.records.run_folder.verify import complete_frames_bytes

PAUSE_NS = NS_PER_S // 100  # between looks whether something has come
START_NS = 30 * NS_PER_S  # how long it may take to listen
START_PAUSE_NS = NS_PER_S // 20
RELOAD_NS = 5 * NS_PER_S  # within which a browser that loads its page again is back
LIVE_MEMORY = "2GB"  # of the live view: then the oldest ticks are dropped
HEAD = b"RRF2"  # how a recording begins


@dataclass(frozen=True)
class Viewer:
    """A viewer on this machine, which no other one reaches."""

    target: Target  # that a run is drawn in
    address: str | None  # for a browser, with a token in it; None: it has a window
    alive: Callable[[], bool]  # closing the window ends it
    left: Callable[[], bool] = lambda: False  # whether browsers showed it, and all have closed it


class Departure:
    """Looks whether there were readers, and all have gone for longer than a browser takes to load a page again."""

    def __init__(self, clock: Clock, readers: Callable[[], int]) -> None:
        """`readers` tells how many there are now; a call of this object looks, and must come often."""
        self._clock, self._readers = clock, readers
        self._last_ns: int | None = None  # when there was one; None: never

    def __call__(self) -> bool:
        """Whether all have gone."""
        now_ns = self._clock.now_ns()
        if self._readers():
            self._last_ns = now_ns
        return self._last_ns is not None and now_ns - self._last_ns > RELOAD_NS


@contextmanager
def window(clock: Clock, recording: Path | None) -> Generator[Viewer]:
    """A window with this recording or for what is to come, which is closed after the block."""
    options = ["--hide-welcome-screen"]
    options += ["--memory-limit", LIVE_MEMORY, "--server-memory-limit", LIVE_MEMORY] if recording is None else []
    with rerun(clock, [*options, *([str(recording)] if recording else [])]) as (process, host, ports):
        yield Viewer(f"rerun+http://{host}:{ports[0]}/proxy", None, lambda: process.poll() is None)


@contextmanager
def rerun(
    clock: Clock, options: Sequence[str], *, web: bool = False
) -> Generator[tuple["subprocess.Popen[bytes]", str, Sequence[int]]]:
    """Rerun's program with these options, its address and its ports, once it listens; it has ended after the block.

    The ports are that for data and, with `web`, that of its pages.
    """
    host = hidden_loopback()
    ports = [free_port(host) for _ in range(1 + web)]
    listening = ["--bind", host, "--port", str(ports[0])]
    listening += ["--serve-web", "--web-viewer-port", str(ports[1])] if web else []
    with TemporaryFile() as log:  # without a name: whoever kills this process leaves none behind
        command = ending_with_this([str(program()), *listening, *options])
        environment = {**closed_environment(), "RUST_LOG": "warn"}
        process = subprocess.Popen(command, env=environment, stdout=log, stderr=log)
        try:
            until_ns = clock.now_ns() + START_NS
            while not all(is_open(port, host) for port in ports):
                if process.poll() is not None or clock.now_ns() > until_ns:
                    hint = "" if web else "; --web shows the run in a browser"
                    raise SwarmwireError(f"rerun's viewer did not start{hint}\n{_end_of(log)}")
                clock.sleep_until(clock.now_ns() + START_PAUSE_NS)
            yield process, host, ports
        finally:
            end(process)


def _end_of(log: IO[bytes]) -> str:
    log.seek(0)
    return log.read().decode(errors="replace")[-2000:].strip()


def has_screen() -> bool:
    """Whether a window can be opened here."""
    return sys.platform == "darwin" or any(os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY"))


@contextmanager
def whole(recording: Path) -> Generator[Path]:
    """The recording, or a temporary copy that the viewer can open; BadInput if there is nothing to see in it."""
    if not recording.is_file():
        raise BadInput(str(recording), "", "there is no such recording")
    with recording.open("rb") as file:
        head = file.read(len(HEAD))
    if head != HEAD:
        raise BadInput(str(recording), "", "expected a recording (.rrd) with at least a tick in it")
    if complete_frames_bytes(recording) == recording.stat().st_size:
        yield recording
        return
    with TemporaryDirectory(prefix="swarmwire-view-") as directory:
        copy = Path(directory, recording.name)
        done = subprocess.run(
            [program(), "rrd", "optimize", recording, "-o", copy],
            env=closed_environment(),
            capture_output=True,
            text=True,
            check=False,
        )
        if done.returncode or not copy.is_file():
            raise BadInput(str(recording), "", f"expected a recording that can be read: {done.stderr[-500:].strip()}")
        yield copy


@dataclass(frozen=True)
class ViewOptions:
    """How a run is shown, and for how long."""

    clock: Clock
    say: Callable[[str], None]  # to the person who looks on
    stopped: Callable[[], bool]  # whether that person has enough
    web: bool = False  # pages for a browser instead of a window
    port: int | None = None  # of the pages; None: any that is free

    def viewer(self, recording: Path | None) -> AbstractContextManager[Viewer]:
        """The viewer, with this recording or for what is to come."""
        if not self.web:
            return window(self.clock, recording)
        from swarmwire.deploy.live.page.web_viewer import web_viewer  # needs the extra [ui]

        return web_viewer(self.clock, recording, self.port)

    def pause(self) -> None:
        """A moment, before it is looked again whether something has happened."""
        self.clock.sleep_until(self.clock.now_ns() + PAUSE_NS)


def show_recording(recording: Path, options: ViewOptions) -> None:
    """Show a recording, also of a run that was killed, until the viewer is closed or `options.stopped()`."""
    with whole(recording) as complete, options.viewer(complete) as shown:
        _say_where(shown, options)
        while shown.alive() and not options.stopped():
            options.pause()


def show_live(live: Live, options: ViewOptions) -> None:
    """Show a live run, and its recording afterwards, until the viewer is closed or stopped.

    A browser's tab may be closed and opened again while the run lasts; after the run, closing it ends the view.

    RunGone if the run does not answer.
    """
    with following(live) as run, options.viewer(None) as shown:
        _say_where(shown, options)
        drawer = Drawer(run, shown.target, options)
        drawer.start()
        told = False
        while shown.alive() and not options.stopped() and drawer.fault is None:
            left = shown.left()
            if run.over and left:
                break
            if run.over and not told:
                told = True
                options.say(f"the run is over{_missed(run)}; closing the view, or Ctrl-C, ends it")
            options.pause()
    if drawer.fault is not None:
        raise drawer.fault


class Drawer(threading.Thread):
    """Draws glimpses of a run until it is over.

    In a daemon thread: drawing stands still while the viewer does, and ends with it.
    """

    def __init__(
        self, run: Following, target: Target, options: ViewOptions, page: Callable[[ObservedTick], None] | None = None
    ) -> None:
        """Draw in the viewer with this target; if it is that of a page, the page gets each glimpse before."""
        super().__init__(name="drawer", daemon=True)
        self._run, self._way, self._page, self._evened = run, options, page, Evened()
        self._drawing = RerunLive(target, run, options.clock, selected=run.scene.selected, page=page is not None)
        self.fault: Exception | None = None

    def run(self) -> None:
        """Draw."""
        try:
            self._drawing.begin(self._run.scene.static)
            while not self._run.over:
                if not self._draw():
                    self._way.pause()
            self._drawing.end(None)
        except Exception as error:  # noqa: BLE001 - the thread that waits for the viewer raises it
            self.fault = error

    def _draw(self) -> bool:
        glimpse = self._run.next()
        if glimpse is None:
            return False
        if self._page is not None:
            self._page(glimpse)
        truth = glimpse.truth
        tally = None if truth.tally is None else self._evened.per_tick(truth.tally, glimpse.ticks)
        self._drawing.see(replace(truth, tally=tally))
        return True


class Evened:
    """Mean tallies per tick in whole numbers: what rounding leaves over comes with a later one."""

    def __init__(self) -> None:
        self._owed: FloatArray | None = None

    def per_tick(self, tally: PacketCounts, ticks: int) -> PacketCounts:
        """The tally of one of these ticks."""
        counts: IntArray = np.vstack([tally.sent, tally.intended, tally.in_range, tally.fates.T])
        owed = counts / ticks + (0.0 if self._owed is None else self._owed)
        whole = np.floor(owed + 1e-9).astype(np.int64)  # thirds add up to a little less than one
        self._owed = owed - whole
        return PacketCounts(whole[0], whole[1], whole[2], whole[3:].T)


def _say_where(shown: Viewer, options: ViewOptions) -> None:
    if shown.address is not None:
        options.say(f"open {shown.address} in a browser; Ctrl-C ends the view")


def _missed(run: Following) -> str:
    return f" ({run.lost} frames did not arrive in time)" if run.lost else ""
