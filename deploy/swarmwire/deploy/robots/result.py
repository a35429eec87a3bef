"""Results of a command, one for each robot: how they are made, watched and printed as lines."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from swarmwire.comms.base.errors import SwarmwireError


class HostFailed(SwarmwireError):
    """A robot's host cannot be reached or cannot do the request: the reason and a remedy. Other robots continue."""

    def __init__(self, cause: str, cure: str = "") -> None:
        self.cause, self.cure = cause, cure
        super().__init__("; ".join(filter(None, (cause, cure))))


@dataclass(frozen=True)
class RobotResult:
    """One robot's line: whether it is as was asked, what there is to say, and what helps if it is not."""

    robot: str
    good: bool
    said: str
    cure: str = ""

    @classmethod
    def failed(cls, robot: str, error: HostFailed) -> "RobotResult":
        """The line of a robot for which it did not work."""
        return cls(robot, False, error.cause, error.cure)


class Watcher(Protocol):
    """Receives the progress of each robot."""

    def step(self, robot: str, doing: str, done: int = 0, total: int = 0) -> None:
        """Something begins, or has got to `done` of `total` bytes."""
        ...

    def end(self, result: RobotResult) -> None:
        """A robot is through."""
        ...


class Silent:
    """No observer."""

    def step(self, robot: str, doing: str, done: int = 0, total: int = 0) -> None:
        """Nothing to do."""

    def end(self, result: RobotResult) -> None:
        """Nothing to do."""


SILENT = Silent()


def result_lines(results: Sequence[RobotResult]) -> list[str]:
    """A line per robot, names below one another."""
    from swarmwire.deploy.terminal.tables import aligned  # rich, for which no emergency stop waits

    return aligned([(result.robot, _told(result)) for result in results])


def _told(result: RobotResult) -> str:
    said = " ".join(result.said.split())
    return said if result.good else f"failed: {said}" + (f"; {' '.join(result.cure.split())}" if result.cure else "")
