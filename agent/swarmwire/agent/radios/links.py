"""What a robot's radio knows of its neighbours: how many of each one's packets arrived, and how many did not."""

from dataclasses import dataclass


@dataclass(slots=True)
class Link:
    """From one sender to this robot.

    Attributes:
        heard: packets that arrived.
        missed: numbers that were left out before one that arrived.
        heard_at_ns: when the last one arrived, by the robot's monotonic clock.
    """

    heard: int = 0
    missed: int = 0
    heard_at_ns: int = 0
    newest: int = -1  # highest number that the sender had used
    newest_utc_ns: int = 0  # when it sent that, by its own clock

    def add(self, sequence: int, sent_utc_ns: int, heard_at_ns: int) -> None:
        """A packet arrived. One that was overtaken fills its gap; a sender that began anew counts from 0 again."""
        first = self.heard == 0
        self.heard += 1
        self.heard_at_ns = heard_at_ns
        if sequence > self.newest:
            self.missed += 0 if first else sequence - self.newest - 1
        elif sent_utc_ns <= self.newest_utc_ns:
            self.missed -= sequence < self.newest and self.missed > 0
            return
        self.newest, self.newest_utc_ns = sequence, sent_utc_ns

    @property
    def delivery(self) -> float:
        """Share of packets that arrived, 0 to 1, since the first one did; NaN before it."""
        return self.heard / (self.heard + self.missed) if self.heard else float("nan")
