"""Whoever looks on while a campaign goes on."""

from typing import Protocol

from swarmwire.deploy.campaign.campaign import Campaign
from swarmwire.deploy.campaign.task import TaskResult


class Watcher(Protocol):
    """Is told of what is done; it is shown to people, so nothing depends on it."""

    def begin(self, campaign: Campaign, done: int, failed: int) -> None:
        """Work begins; so many runs have rows already, of which so many failed."""
        ...

    def see(self, result: TaskResult) -> None:
        """A task is done and kept."""
        ...

    def end(self) -> None:
        """Work is over, however it ended."""
        ...


class NobodyWatches:
    """Shows nothing."""

    def begin(self, campaign: Campaign, done: int, failed: int) -> None:
        """Nothing."""

    def see(self, result: TaskResult) -> None:
        """Nothing."""

    def end(self) -> None:
        """Nothing."""
