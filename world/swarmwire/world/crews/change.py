"""What became of runners while a run went on: who joined, left, was lost and returned."""

from dataclasses import dataclass
from typing import Literal

from swarmwire.comms.assignment import robots_text

What = Literal["joined", "left", "lost", "returned"]


@dataclass(frozen=True)
class Change:
    """One runner that came or went."""

    what: What
    runner: str
    robots: tuple[str, ...]  # names
    tick: int  # that was open; -1: before the first
    reason: str = ""  # why it was lost

    def __str__(self) -> str:
        when = "before the first tick" if self.tick < 0 else f"in tick {self.tick}"
        told = f"{self.runner} {_SAID[self.what]} {robots_text(list(self.robots))} {when}"
        return told + (f": {self.reason}" if self.reason else "")


_SAID: dict[What, str] = {
    "joined": "joined with",
    "left": "left",
    "lost": "was lost with",
    "returned": "returned to",
}
