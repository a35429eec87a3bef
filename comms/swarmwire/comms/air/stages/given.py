"""What a receiver learns of where a sender was, whichever column it is."""

from collections.abc import Callable

from swarmwire.comms.air.links import Links
from swarmwire.comms.air.stages.stage import Medium, Stage
from swarmwire.comms.arrays import FloatArray


class Given(Stage):
    """Fills a column of what is given with what a kernel measures between two poses, with its error.

    Args:
        medium: whose radio gives the column.
        column: its name.
        noise: deviation of the error, in the column's unit.
        measured: kernel of (keys, robots, wrap_m, pose, sender, receiver, sequence, fate, noise): (k,).
    """

    def __init__(self, medium: Medium, column: str, noise: float, measured: Callable[..., FloatArray]) -> None:
        self._keys, self._robots, self._wrap_m = medium.keys, medium.robots, medium.wrap_m
        self._column = medium.radio.gives.columns.index(column)
        self._noise, self._measured = noise, measured

    def decide(self, links: Links, pose: FloatArray) -> None:
        """Fill the column, for links that ended with 0."""
        who = links.sender, links.receiver, links.sequence
        links.given[:, self._column] = self._measured(
            self._keys, self._robots, self._wrap_m, pose, *who, links.fate, self._noise
        )
