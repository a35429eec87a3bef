"""`swarmwire robots`: its commands, one a file."""
