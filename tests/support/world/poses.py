"""Live sources of poses for tests."""

from swarmwire.world.motion.live import LiveSource


class GivenPoses(LiveSource):
    """A source whose poses the test puts."""

    address = "given"

    def open(self) -> None:
        """Do nothing."""

    def close(self) -> None:
        """Do nothing."""
