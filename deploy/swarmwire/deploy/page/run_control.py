"""What the page may ask of a run: as `RemoteControl` does it, whatever carries it there."""

from collections.abc import Mapping
from typing import Any, Protocol


class RunControl(Protocol):
    """A run that goes on; every call raises Refused with the run's own line, or RunGone."""

    def status(self) -> Mapping[str, Any]:
        """Where the run stands, what it measured, and what happened in it."""
        ...

    def pause(self) -> None:
        """No tick begins until `resume` or `step`."""
        ...

    def resume(self) -> None:
        """Go on."""
        ...

    def step(self, n: int = 1) -> None:
        """So many ticks, then pause again."""
        ...

    def speed(self, factor: float | None) -> None:
        """At most so many simulated seconds per second of wall time; None: as fast as possible."""
        ...

    def stop(self) -> None:
        """End the run after the tick under way."""
        ...

    def event(self, table: Mapping[str, Any]) -> int:
        """Let something happen at the start of the next tick: a scenario's event without `at_s`. Its number."""
        ...

    def end(self, number: int) -> None:
        """Undo an event that lasts."""
        ...
