"""The progress line of a run."""

from typing import Any

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

from swarmwire.comms.clock import Clock, to_s
from swarmwire.comms.truth import Static, Tally, Truth

REDRAW_S = 0.1
PLAIN_SHARE = 0.25  # without a terminal: a line each time that so much more is done


class ProgressLine:
    """Observer that shows how far a run is and how fast: a line that moves, or a few plain ones without a terminal."""

    def __init__(self, ticks: int, clock: Clock, console: Console) -> None:
        self._ticks, self._clock, self._console = ticks, clock, console
        self._progress = Progress(
            TextColumn("{task.description}"),
            BarColumn(),
            TextColumn("{task.fields[speed]}"),
            TimeRemainingColumn(),
            console=console,
            auto_refresh=False,
            transient=True,
        )
        self._drawn_s = 0.0
        self._next_share = PLAIN_SHARE

    def begin(self, static: Static) -> None:
        """Show the line."""
        self._began_ns = self._clock.now_ns()
        if self._console.is_terminal:
            self._progress.start()
            self._task = self._progress.add_task(static.name, total=self._ticks, speed="")
        else:
            size = f"{static.robots} robots" + (f" in each of {static.arenas} arenas" if static.arenas > 1 else "")
            self._console.print(f"{static.name}: {size}, {self._ticks} ticks at {static.rate_hz} Hz")

    def see(self, truth: Truth) -> None:
        """Move it, a few times a second at most."""
        wall_s = to_s(self._clock.now_ns() - self._began_ns)
        done = truth.tick + 1
        speed = f"{to_s(truth.time_ns) / wall_s if wall_s else 0.0:.1f} x real time"
        if self._console.is_terminal:
            if wall_s - self._drawn_s >= REDRAW_S:
                self._drawn_s = wall_s
                self._progress.update(self._task, completed=done, speed=f"tick {done}/{self._ticks}, {speed}")
                self._progress.refresh()
        elif done >= self._next_share * self._ticks:
            self._next_share += PLAIN_SHARE
            self._console.print(f"tick {done}/{self._ticks}, {to_s(truth.time_ns):.1f} s simulated, {speed}")

    def end(self, last: Tally | None) -> dict[str, Any]:
        """Take it away."""
        self._progress.stop()
        return {}
