"""The error of a host on which something cannot be done."""

from swarmwire.comms.errors import SwarmwireError


class HostFailed(SwarmwireError):
    """A robot's host cannot be reached, or not do what was asked: why, and what helps. Others go on."""

    def __init__(self, cause: str, cure: str = "") -> None:
        self.cause, self.cure = cause, cure
        super().__init__("; ".join(filter(None, (cause, cure))))
