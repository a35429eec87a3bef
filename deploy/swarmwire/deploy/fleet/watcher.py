"""Whoever looks on while something is done to robots."""

from typing import Protocol

from swarmwire.deploy.fleet.result import Result


class Watcher(Protocol):
    """Told of each robot what is done to it."""

    def step(self, robot: str, doing: str, done: int = 0, total: int = 0) -> None:
        """Something begins, or has got to `done` of `total` bytes."""
        ...

    def end(self, result: Result) -> None:
        """A robot is through."""
        ...


class Silent:
    """Nobody looks on."""

    def step(self, robot: str, doing: str, done: int = 0, total: int = 0) -> None:
        """Nothing to do."""

    def end(self, result: Result) -> None:
        """Nothing to do."""


SILENT = Silent()
