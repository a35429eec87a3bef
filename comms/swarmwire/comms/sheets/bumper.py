"""The bumper."""

from dataclasses import dataclass

from swarmwire.comms.sheets.sheet import Sheet


@dataclass(frozen=True)
class Bumper(Sheet):
    """A touch-sensitive rim. Sense: pressed (n,), 1 if the body touched anything in the tick before, else 0."""
