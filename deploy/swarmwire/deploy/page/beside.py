"""The page of a run that this process executes: the run waits for it, and goes on without if it cannot be had."""

from pathlib import Path
from typing import Any

from rich.console import Console

from swarmwire.comms.truth import PacketCounts, Static
from swarmwire.deploy.live.live_view import LiveView
from swarmwire.deploy.simulation import Simulation

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
            held = "paused: swarmwire ctl resume lets it go on" if controls.paused else "going on"
            self._print(f"the page has ended, the run is {held}; swarmwire ui opens another page")
