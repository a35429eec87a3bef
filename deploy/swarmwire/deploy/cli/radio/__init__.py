"""`swarmwire radio`: its commands, one a file."""
