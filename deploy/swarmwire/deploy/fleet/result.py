"""What became of a command for one robot."""

from dataclasses import dataclass

from swarmwire.deploy.fleet.host_failed import HostFailed


@dataclass(frozen=True)
class Result:
    """One robot's line: whether it is as was asked, what there is to say, and what helps if it is not."""

    robot: str
    good: bool
    said: str
    cure: str = ""

    @classmethod
    def failed(cls, robot: str, error: HostFailed) -> "Result":
        """The line of a robot for which it did not work."""
        return cls(robot, False, error.cause, error.cure)
