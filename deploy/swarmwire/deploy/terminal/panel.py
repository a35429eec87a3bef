"""The live panel of a run in a terminal."""

from collections.abc import Callable
from functools import partial
from typing import Any

from rich.console import Console, ConsoleOptions, RenderResult
from rich.live import Live

from swarmwire.comms.clock import Clock, to_ns
from swarmwire.comms.interfaces import Observer
from swarmwire.comms.truth import PacketCounts, Static, Truth
from swarmwire.deploy.controls import Controls
from swarmwire.deploy.terminal.bindings import press
from swarmwire.deploy.terminal.figures import Figures
from swarmwire.deploy.terminal.keys import Keys
from swarmwire.deploy.terminal.panel_view import panel_view
from swarmwire.metrics.measure import Metrics
from swarmwire.world.backends.registry import RunnerHealth

REDRAW_NS, SELDOM_NS = to_ns(0.1), to_ns(0.5)  # wall time between two pictures, at least and at most
COST = 250  # a picture that took so long is followed by so many times as long without one: below 1 % of a run


class Panel(Observer):
    """Observer that shows how a run is doing, and hands the keys that people type to its controls."""

    def __init__(
        self,
        ticks: int,
        metrics: Metrics,
        controls: Controls,
        health: Callable[[], RunnerHealth | None],
        clock: Clock,
        console: Console,
    ) -> None:
        """Of a run of so many ticks; `metrics` must see each tick before; `health` gives None without runners."""
        self._controls, self._health, self._clock, self._console = controls, health, clock, console
        self.figures = Figures(ticks, metrics, clock)
        self._keys = Keys(partial(press, controls))
        self._live = Live(self, console=console, auto_refresh=False, transient=True, vertical_overflow="crop")
        self._next_ns = 0  # no picture before
        self._broken: Exception | None = None

    def begin(self, static: Static) -> None:
        """Show it."""
        self.figures.begin(static)
        self._controls.on_wait = self._wait
        self._keys.start()
        try:
            self._live.start()
            self._draw()
        except BaseException:  # also Ctrl-C and rich's SystemExit must not leave the terminal without its echo
            self.end(None)
            raise

    def see(self, truth: Truth) -> None:
        """Add a tick, and draw it if it is time; OSError if the terminal is gone."""
        self.figures.see(truth)
        if self._broken is not None:
            self._controls.on_wait = lambda: None
            raise self._broken
        if self._clock.now_ns() >= self._next_ns:
            cost_ns = self._draw()
            self._next_ns += min(max(COST * cost_ns, REDRAW_NS), SELDOM_NS) - REDRAW_NS

    def end(self, last: PacketCounts | None) -> dict[str, Any]:
        """Take it away."""
        self._controls.on_wait = lambda: None
        try:
            self._live.stop()
        finally:
            self._keys.stop()
        return {}

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        """The panel of this moment."""
        yield panel_view(self.figures, self._controls, self._health(), options.max_width, keys=self._keys.active)

    def _wait(self) -> None:
        """The loop is held: no tick comes, but people may have asked for something."""
        if self._controls.paused:
            self.figures.forget_speed()
        if self._broken is None and self._clock.now_ns() >= self._next_ns:
            try:
                self._draw()
            except Exception as error:  # noqa: BLE001 - nothing catches it here; the next tick reports it
                self._broken = error

    def _draw(self) -> int:
        """Returns how long it took, in ns."""
        before_ns = self._clock.now_ns()
        self._live.refresh()
        self._next_ns = before_ns + REDRAW_NS
        return self._clock.now_ns() - before_ns
