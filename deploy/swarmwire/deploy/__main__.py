"""`python -m swarmwire.deploy` is the command `swarmwire`."""

from swarmwire.deploy.cli import program

program()
