"""A live run in rerun's viewer, drawn tick by tick."""

import threading
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from swarmwire.comms.base.arrays import FloatArray, IntArray
from swarmwire.comms.observe.run_views import ObservedTick
from swarmwire.comms.radio.records import PacketCounts
from swarmwire.deploy.live.subscription import RunSubscription, subscribe
from swarmwire.deploy.live.viewer import ViewOptions, report_address
from swarmwire.deploy.runs.live_address import Live
from swarmwire.metrics.pictures.viewer.program import Target
from swarmwire.metrics.pictures.viewer.recording import RerunLive


def show_live(live: Live, options: ViewOptions) -> None:
    """Show a live run, and its recording afterwards, until the viewer is closed or stopped.

    A browser's tab may be closed and opened again while the run lasts; after the run, closing it ends the view.

    RunGone if the run does not answer.
    """
    with subscribe(live) as run, options.viewer(None) as viewer:
        report_address(viewer, options)
        drawer = Drawer(run, viewer.target, options)
        drawer.start()
        reported = False
        while viewer.alive() and not options.stopped() and drawer.fault is None:
            abandoned = viewer.abandoned()
            if run.over and abandoned:
                break
            if run.over and not reported:
                reported = True
                options.report(f"the run is over{_missed(run)}; closing the view, or Ctrl-C, ends it")
            options.pause()
    if drawer.fault is not None:
        raise drawer.fault


class Drawer(threading.Thread):
    """Thread that draws the ticks of a run until it is over.

    It is a daemon, since drawing blocks while the viewer does not read.
    """

    def __init__(
        self,
        run: RunSubscription,
        target: Target,
        options: ViewOptions,
        page: Callable[[ObservedTick], None] | None = None,
    ) -> None:
        """Draw into this target; `page` is called with each tick before."""
        super().__init__(name="drawer", daemon=True)
        self._run, self._options, self._page, self._rounding = run, options, page, CarriedRounding()
        self._drawing = RerunLive(target, run, options.clock, selected=run.scene.selected, page=page is not None)
        self.fault: Exception | None = None

    def run(self) -> None:
        """Draw until the run is over."""
        try:
            self._drawing.begin(self._run.scene.static)
            while not self._run.over:
                if not self._draw():
                    self._options.pause()
            self._drawing.end(None)
        except Exception as error:  # noqa: BLE001 - raised by the thread that waits for the viewer
            self.fault = error

    def _draw(self) -> bool:
        observed = self._run.next()
        if observed is None:
            return False
        if self._page is not None:
            self._page(observed)
        truth = observed.truth
        tally = None if truth.tally is None else self._rounding.per_tick(truth.tally, observed.ticks)
        self._drawing.see(replace(truth, tally=tally))
        return True


class CarriedRounding:
    """Mean tallies per tick in whole numbers; the remainders of rounding are added to later ones."""

    def __init__(self) -> None:
        self._remainder: FloatArray | None = None

    def per_tick(self, tally: PacketCounts, ticks: int) -> PacketCounts:
        """Return the mean tally of these ticks."""
        counts: IntArray = np.vstack([tally.sent, tally.intended, tally.in_range, tally.fates.T])
        exact = counts / ticks + (0.0 if self._remainder is None else self._remainder)
        rounded = np.floor(exact + 1e-9).astype(np.int64)  # three thirds are slightly less than one
        self._remainder = exact - rounded
        return PacketCounts(sent=rounded[0], intended=rounded[1], in_range=rounded[2], fates=rounded[3:].T)


def _missed(run: RunSubscription) -> str:
    return f" ({run.lost} frames did not arrive in time)" if run.lost else ""
