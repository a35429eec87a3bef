"""`python -m swarmwire.deploy` is the command `swarmwire`."""

from swarmwire.deploy.cli.program import program

program()
