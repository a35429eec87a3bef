"""`python -m swarmwire.deploy` is the command `swarmwire`."""

from swarmwire.deploy.cli.app import program

program()
