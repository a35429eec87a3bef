"""The command line `swarmwire`."""

from swarmwire.deploy.cli.app import program

__all__ = ["program"]
