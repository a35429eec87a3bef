"""Showing a run: the viewer, and while the run goes on a thread that draws in it what the run publishes."""

import threading
from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from pathlib import Path

from swarmwire.comms.clock import NS_PER_S, Clock
from swarmwire.comms.run_views import ObservedTick
from swarmwire.deploy.live.evened import Evened
from swarmwire.deploy.live.following import Following, following
from swarmwire.deploy.live.live_file import Live
from swarmwire.deploy.live.viewer_program import Viewer, viewer
from swarmwire.deploy.live.whole_recording import whole
from swarmwire.metrics.viewer.recording import RerunLive

PAUSE_NS = NS_PER_S // 100  # between looks whether something has come


@dataclass(frozen=True)
class RadioModel:
    """How a run is shown, and for how long."""

    clock: Clock
    say: Callable[[str], None]  # to the person who looks on
    stopped: Callable[[], bool]  # whether that person has enough
    web: bool = False  # pages for a browser instead of a window
    port: int | None = None  # of the pages; None: any that is free

    def viewer(self, recording: Path | None) -> AbstractContextManager[Viewer]:
        """The viewer, with this recording or for what is to come."""
        return viewer(self.clock, recording, self.web, self.port)

    def pause(self) -> None:
        """A moment, before it is looked again whether something has happened."""
        self.clock.sleep_until(self.clock.now_ns() + PAUSE_NS)


def show_recording(recording: Path, way: RadioModel) -> None:
    """Show a recording, also of a run that was killed, until the viewer is closed or `way.stopped()`."""
    with whole(recording) as complete, way.viewer(complete) as shown:
        _say_where(shown, way)
        while shown.alive and not way.stopped():
            way.pause()


def show_live(live: Live, way: RadioModel) -> None:
    """Show a run while it goes on and what there was to see afterwards, until the viewer is closed or stopped.

    RunGone if the run does not answer.
    """
    with following(live) as run, way.viewer(None) as shown:
        _say_where(shown, way)
        drawer = Drawer(run, shown.url, way)
        drawer.start()
        told = False
        while shown.alive and not way.stopped() and drawer.fault is None:
            if run.over and not told:
                told = True
                way.say(f"the run is over{_missed(run)}; Ctrl-C ends the view")
            way.pause()
    if drawer.fault is not None:
        raise drawer.fault


class Drawer(threading.Thread):
    """Draws glimpses of a run until it is over.

    In a thread that nobody waits for: drawing stands still while the viewer does, and ends with it.
    """

    def __init__(
        self, run: Following, url: str, way: RadioModel, page: Callable[[ObservedTick], None] | None = None
    ) -> None:
        """Draw in the viewer that listens at `url`; if it is that of a page, the page gets each glimpse before."""
        super().__init__(name="drawer", daemon=True)
        self._run, self._way, self._page, self._evened = run, way, page, Evened()
        self._drawing = RerunLive(url, run, way.clock, selected=run.scene.selected, page=page is not None)
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


def _say_where(shown: Viewer, way: RadioModel) -> None:
    if shown.page is not None:
        way.say(f"open {shown.page} in a browser; Ctrl-C ends the view")


def _missed(run: Following) -> str:
    return f" ({run.lost} frames did not arrive in time)" if run.lost else ""
