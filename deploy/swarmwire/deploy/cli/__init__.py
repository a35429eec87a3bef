"""The command line `swarmwire`."""

from swarmwire.deploy.cli.program import program

__all__ = ["program"]
