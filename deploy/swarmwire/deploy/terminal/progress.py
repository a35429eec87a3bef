"""The progress of a run in plain lines, for what is no terminal."""

import math

from rich.console import Console

from swarmwire.comms.clock import Clock, to_s
from swarmwire.comms.interfaces import Observer
from swarmwire.comms.truth import Static, Truth
from swarmwire.deploy.terminal.figures import Figures
from swarmwire.metrics.measure import Metrics

SHARE = 0.25  # a line each time that so much more is done


class ProgressLines(Observer):
    """Observer that prints a few lines: how far a run is, how fast, and how the swarm and its radio are doing."""

    def __init__(self, ticks: int, metrics: Metrics, clock: Clock, console: Console) -> None:
        """Of a run of so many ticks; `metrics` must see each tick before."""
        self._figures = Figures(ticks, metrics, clock)
        self._ticks, self._clock, self._console = ticks, clock, console
        self._next_share = SHARE

    def begin(self, static: Static) -> None:
        """Say what runs."""
        self._figures.begin(static)
        self._began_ns = self._clock.now_ns()
        size = f"{static.robots} robots" + (f" in each of {static.arenas} arenas" if static.arenas > 1 else "")
        self._print(f"{static.name}: {size}, {self._ticks} ticks at {static.rate_hz} Hz")

    def see(self, truth: Truth) -> None:
        """Say how it goes, four times in all."""
        figures = self._figures
        figures.see(truth)
        if figures.done >= self._next_share * self._ticks:
            self._next_share += SHARE
            wall_s = to_s(self._clock.now_ns() - self._began_ns)
            speed = f"{figures.time_s / wall_s if wall_s > 0 else 0.0:.1f} x real time"
            levels = [(name, figures.level(name)) for name in figures.levels] + [("link PDR so far", figures.link_pdr)]
            known = "".join(f", {name} {value:.3g}" for name, value in levels if not math.isnan(value))
            self._print(
                f"tick {figures.done}/{self._ticks}, {figures.time_s:.1f} s simulated, {speed}{known}{figures.gone}"
            )

    def _print(self, text: str) -> None:
        self._console.print(text, markup=False, soft_wrap=True)
