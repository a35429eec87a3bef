"""What a certificate of a swarm's network is for; the register keeps it, the certificate itself is the same for all."""

from swarmwire.comms.config import did_you_mean
from swarmwire.comms.errors import BadInput
from swarmwire.comms.wire.access_control import OPERATOR, TRACKER, WORLD

ROBOT, RUNNER, OBSERVER, ROUTER = "robot", "runner", "observer", "router"
PURPOSES = (ROBOT, TRACKER, OPERATOR, RUNNER, OBSERVER, ROUTER, WORLD)


def checked_purpose(purpose: str | None) -> str | None:
    """The purpose, if one is told; BadInput for one that nobody looks for."""
    if purpose is not None and purpose not in PURPOSES:
        raise BadInput("--for", "", f"expected {did_you_mean(PURPOSES, purpose)}, got {purpose!r}")
    return purpose
