"""Results of a command, one per robot: their lines, and the watchers that follow the progress."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from swarmwire.comms.base.errors import SwarmwireError


class HostFailed(SwarmwireError):
    """A host that cannot be reached or refuses a request: the cause and a remedy. Other robots continue."""

    def __init__(self, cause: str, remedy: str = "") -> None:
        self.cause, self.remedy = cause, remedy
        super().__init__("; ".join(filter(None, (cause, remedy))))


@dataclass(frozen=True)
class RobotResult:
    """Result for one robot."""

    robot: str
    ok: bool
    text: str  # result, or cause of the failure
    remedy: str = ""

    @classmethod
    def failed(cls, robot: str, error: HostFailed) -> "RobotResult":
        """Return the result of a robot whose host failed."""
        return cls(robot, False, error.cause, error.remedy)


class Watcher(Protocol):
    """Receiver of each robot's progress."""

    def step(self, robot: str, activity: str, done: int = 0, total: int = 0) -> None:
        """Note that a robot's activity begins, or that `done` of its `total` bytes are transferred."""
        ...

    def end(self, result: RobotResult) -> None:
        """Note that the work on a robot has ended."""
        ...


class Silent:
    """Watcher that shows nothing."""

    def step(self, robot: str, activity: str, done: int = 0, total: int = 0) -> None:
        """Do nothing."""

    def end(self, result: RobotResult) -> None:
        """Do nothing."""


SILENT = Silent()


def result_lines(results: Sequence[RobotResult]) -> list[str]:
    """Return a line per robot, with aligned names."""
    width = max((len(result.robot) for result in results), default=0)
    return [f"{result.robot:{width}}  {_text(result)}".rstrip() for result in results]


def _text(result: RobotResult) -> str:
    text, remedy = " ".join(result.text.split()), " ".join(result.remedy.split())
    return text if result.ok else "; ".join(filter(None, (f"failed: {text}", remedy)))
